// Fixture of the tests of signatures: a signed take of one node, or of two nodes joined.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/io/whole_file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/message_of.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/join_parts.h"
#include "take/ledger/signature_check.h"
#include "take/ledger/take_account.h"
#include "take/ledger/take_signature.h"
#include "take/logs/frame_log.h"

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
  TakePaths joined_take() {
    for (const char* node : {"cap01", "cap02"}) {
      std::filesystem::create_directories(part(node).folder);
      write_text(part(node).studio(),
                 studio_text({{"cap01", {"cam01", "cam02"}}, {"cap02", {"cam03"}}}));
    }
    record("cap01", {"cam01", "cam02"}, cap01_);
    record("cap02", {"cam03"}, cap02_);
    const TakePaths whole{folder_ / "archive"};
    join_parts({part("cap01"), part("cap02")}, whole);
    return whole;
  }

  /// Signs the text of a signature again, after `change`.
  void resign(const TakePaths& paths, const std::string& node, const SigningKey& key,
              const std::function<void(TakeSignature&)>& change) const {
    const std::filesystem::path file = signature_path(paths, node);
    TakeSignature signature = parse_signature(read_file(file), file);
    change(signature);
    ASSERT_TRUE(save_signature(paths, signature, key));
  }

  void add_camera(const std::string& name, const std::string& node) {
    StudioCamera camera;
    camera.name = name;
    camera.node = node;
    studio_.cameras.push_back(camera);
  }

  TakePaths part(const std::string& node) const { return {folder_ / node}; }

  /// Records a closed take and signs it as v3d-captured does.
  void record(const std::string& node, const std::vector<std::string>& cameras,
              const SigningKey& key) {
    const TakePaths paths = part(node);
    std::filesystem::create_directories(paths.background());
    for (const std::string& camera : cameras) std::filesystem::remove(paths.frames(camera));
    std::filesystem::remove(paths.pulses());
    TakeInfo info = begun_take(cameras);
    info.started =
        RealtimeInstant(std::chrono::seconds(cameras.size()));  // start times of nodes differ
    info.pulses = kSignedPulses;
    info.state = TakeState::kComplete;
    write_text(paths.calib(), "# the rig\n");
    Ledger ledger{
        .take = info.name, .commanded = kSignedPulses, .sensed = kSignedPulses, .cameras = {}};
    EventLogWriter sensed(paths.pulses());
    for (int64_t pulse = 0; pulse < kSignedPulses; ++pulse) {
      PulseMessage message;
      message.pulse = pulse;
      EXPECT_TRUE(sensed.write(message));
    }
    for (const std::string& camera : cameras) {
      write_text(paths.background() / (camera + ".toml"), camera);
      EventLogWriter frames(paths.frames(camera), LogOpening::kNew, LogHashing::kTree);
      CameraAccount account;
      for (int64_t pulse = 0; pulse < kSignedPulses; ++pulse) {
        EXPECT_TRUE(frames.write(recorded_frame(camera, pulse, {64, 48})));
        account.add(pulse, false);
      }
      ledger.cameras.push_back(account.ledger(camera, kSignedPulses));
      ledger.files.push_back(frames.file());
    }
    save_account_or_throw(paths, info, ledger);
    io::throw_if_failed(sign_take(paths, {node, key}, ledger.files));
  }

  /// Signs take_ as `v3dctl takes sign` does.
  io::Status sign_whole(const std::string& node, const SigningKey& key) const {
    return sign_whole_take(take_, {node, key}, SigningOccasion::kCommand);
  }

  SignatureCheck check() const { return check_signatures(take_, &studio_); }
  SignatureCheck check(const TakePaths& paths) const { return check_signatures(paths, &studio_); }

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
    return message_of<InputError>([&] { parse_signature(text, signature_file()); });
  }

  const TemporaryFolder folder_;
  const SigningKey cap01_ = SigningKey::make(), cap02_ = SigningKey::make();
  const TakePaths take_ = part("cap01");
  Studio studio_;
};

}  // namespace v3d::test
