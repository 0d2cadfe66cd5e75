// Fixture of the tests of signatures: a signed take of one node, or of two nodes joined.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/message_of.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/ledger/signature_check.h"
#include "take/ledger/take_account.h"
#include "take/ledger/take_signature.h"
#include "take/logs/frame_log.h"
#include "take/take_transfer.h"

namespace v3d::test {

inline constexpr int64_t kSignedPulses = 3;

class SignedTake : public testing::Test {
 protected:
  SignedTake() {
    record("cap01", {"cam01", "cam02"}, cap01_);
    studio_.nodes = {{"cap01", cap01_.public_key().text()}, {"cap02", cap02_.public_key().text()}};
    add_camera("cam01", "cap01");
    add_camera("cam02", "cap01");
    add_camera("cam03", "cap02");
  }

  /// The parts of a take of two nodes, joined as `takes collect` does. The parts of the other tests
  /// have no studio file: they are takes of one node.
  take::TakePaths joined_take() {
    for (const char* node : {"cap01", "cap02"}) {
      std::filesystem::create_directories(part(node).folder);
      write_text(part(node).studio(),
                 studio_text({{"cap01", {"cam01", "cam02"}}, {"cap02", {"cam03"}}}));
    }
    record("cap01", {"cam01", "cam02"}, cap01_);
    record("cap02", {"cam03"}, cap02_);
    const take::TakePaths whole{folder_ / "archive"};
    take::join_parts({part("cap01"), part("cap02")}, whole);
    return whole;
  }

  /// Signs the text of a signature again, after `change`.
  void resign(const take::TakePaths& paths, const std::string& node, const wire::SigningKey& key,
              const std::function<void(take::TakeSignature&)>& change) const {
    const std::filesystem::path file = take::signature_path(paths, node);
    take::TakeSignature signature = take::parse_signature(read_file(file), file);
    change(signature);
    ASSERT_TRUE(take::save_signature(paths, signature, key));
  }

  void add_camera(const std::string& name, const std::string& node) {
    StudioCamera camera;
    camera.name = name;
    camera.node = node;
    studio_.cameras.push_back(camera);
  }

  take::TakePaths part(const std::string& node) const { return {folder_ / node}; }

  /// Records a closed take and signs it as v3d-captured does.
  void record(const std::string& node, const std::vector<std::string>& cameras,
              const wire::SigningKey& key) {
    const take::TakePaths paths = part(node);
    std::filesystem::create_directories(paths.background());
    for (const std::string& camera : cameras) std::filesystem::remove(paths.frames(camera));
    std::filesystem::remove(paths.pulses());
    take::TakeInfo info = begun_take(cameras);
    info.started =
        RealtimeInstant(std::chrono::seconds(cameras.size()));  // start times of nodes differ
    info.pulses = kSignedPulses;
    info.state = take::TakeState::kComplete;
    write_text(paths.calib(), "# the rig\n");
    take::Ledger ledger{
        .take = info.name, .commanded = kSignedPulses, .sensed = kSignedPulses, .cameras = {}};
    take::EventLogWriter sensed(paths.pulses());
    for (int64_t pulse = 0; pulse < kSignedPulses; ++pulse) {
      wire::PulseMessage message;
      message.pulse = pulse;
      EXPECT_TRUE(sensed.write(message));
    }
    for (const std::string& camera : cameras) {
      write_text(paths.background() / (camera + ".toml"), camera);
      take::EventLogWriter frames(paths.frames(camera), take::LogOpening::kNew,
                                  take::LogHashing::kTree);
      take::CameraAccount account;
      for (int64_t pulse = 0; pulse < kSignedPulses; ++pulse) {
        EXPECT_TRUE(frames.write(recorded_frame(camera, pulse, {64, 48})));
        account.add(pulse, false);
      }
      ledger.cameras.push_back(account.ledger(camera, kSignedPulses));
      ledger.files.push_back(frames.file());
    }
    take::save_account_or_throw(paths, info, ledger);
    io::throw_if_failed(take::sign_take(paths, {node, key}, ledger.files));
  }

  /// Signs take_ as `v3dctl takes sign` does.
  io::Status sign_whole(const std::string& node, const wire::SigningKey& key) const {
    return take::sign_whole_take(take_, {node, key}, take::SigningOccasion::kCommand);
  }

  take::SignatureCheck check() const { return check_signatures(take_, &studio_); }
  take::SignatureCheck check(const take::TakePaths& paths) const {
    return check_signatures(paths, &studio_);
  }

  void change(const std::filesystem::path& file, const std::string& from,
              const std::string& to) const {
    std::string text = read_file(file);
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos);
    text.replace(at, from.size(), to);
    write_text(file, text);
  }
  std::filesystem::path signature_file() const { return take_.folder / "signature.cap01.toml"; }
  std::string error_message(const std::string& text) const {
    return message_of<InputError>([&] { take::parse_signature(text, signature_file()); });
  }

  const TemporaryFolder folder_;
  const wire::SigningKey cap01_ = wire::SigningKey::make(), cap02_ = wire::SigningKey::make();
  const take::TakePaths take_ = part("cap01");
  Studio studio_;
};

}  // namespace v3d::test
