#include "v3dctl/import/take_builder.h"

#include <cstdlib>
#include <numeric>
#include <stdexcept>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/name.h"
#include "base/io/file.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_account.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

fs::path checked_folder(fs::path folder) {
  folder = fs::absolute(folder).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  const std::string name = folder.filename();
  if (!is_file_name(name)) {
    throw InputError(
        folder.string() + ": '" + name +
        "' is no take name; expected up to 64 letters, digits, '-', '_' and '.', not starting "
        "with '-' or '.'");
  }
  if (fs::exists(folder)) {
    throw InputError(folder.string() + ": exists; expected another name");
  }
  return folder;
}

fs::path make_temporary_beside(const fs::path& folder) {
  std::string pattern = folder.string() + ".partial-XXXXXX";
  if (!mkdtemp(pattern.data())) throw InputError(errno_message(folder.parent_path().string()));
  fs::permissions(pattern, fs::perms(0755));
  return pattern;
}

}  // namespace

TakeBuilder::TakeBuilder(const fs::path& folder, std::vector<std::string> cameras, double rate_hz,
                         const Rig& rig)
    : folder_(checked_folder(folder)), paths_{make_temporary_beside(folder_)} {
  info_.name = folder_.filename();
  info_.studio = "import";
  info_.rate_hz = rate_hz;
  info_.software_version = V3D_VERSION;
  info_.started = Realtime::now();
  info_.cameras = std::move(cameras);
  save_calib(paths_.calib(), rig);
  pulse_log_.emplace(paths_.pulses());
  for (const std::string& camera : info_.cameras) frame_logs_.emplace_back(paths_.frames(camera));
}

TakeBuilder::~TakeBuilder() {
  if (finished_) return;
  std::error_code ignored;
  fs::remove_all(paths_.folder, ignored);
}

// Imported images have no clock: pulse n is labelled n periods after the start of the import.
FrameLabel TakeBuilder::label() const {
  FrameLabel label;
  label.pulse = pulses_;
  label.camera_counter = static_cast<uint64_t>(pulses_);
  label.device_time = DeviceInstant(from_seconds(static_cast<double>(pulses_) / info_.rate_hz));
  label.received = info_.started + label.device_time.time_since_epoch();
  return label;
}

void TakeBuilder::add_pulse(std::vector<Shot> shots) {
  FrameMessage message;
  message.seq = pulses_;
  message.take = info_.name;
  message.frame.label = label();
  message.sent = message.frame.label.received;
  for (size_t camera = 0; camera < shots.size(); ++camera) {
    Frame& frame = message.frame;
    frame.camera = info_.cameras[camera];
    frame.image = std::move(shots[camera].image);
    frame.mask = std::move(shots[camera].mask);
    frame.sensor_size = frame.image.size;
    frame.roi = {0, 0, frame.image.size.width, frame.image.size.height};
    io::throw_if_failed(frame_logs_[camera].write(message));
  }
  PulseMessage pulse;
  pulse.sent = pulse.edge = message.sent;
  pulse.edge_monotonic = MonotonicInstant(message.frame.label.device_time.time_since_epoch());
  pulse.seq = pulse.pulse = pulses_;
  pulse.take = info_.name;
  io::throw_if_failed(pulse_log_->write(pulse));
  ++pulses_;
}

void TakeBuilder::finish() {
  std::vector<int64_t> pulses(static_cast<size_t>(pulses_));
  std::iota(pulses.begin(), pulses.end(), 0);
  Ledger ledger;
  ledger.take = info_.name;
  ledger.commanded = pulses_;
  ledger.sensed = pulses_;
  for (const std::string& camera : info_.cameras) {
    ledger.cameras.push_back(account(camera, pulses, {}, pulses_));
  }
  info_.pulses = pulses_;
  info_.state = TakeState::kComplete;
  for (EventLogWriter& log : frame_logs_) io::throw_if_failed(log.sync());
  io::throw_if_failed(pulse_log_->sync());
  for (const EventLogWriter& log : frame_logs_) ledger.files.push_back(log.file());
  save_account_or_throw(paths_, info_, ledger);
  io::throw_if_failed(io::rename_new(paths_.folder, folder_));
  finished_ = true;
}

}  // namespace v3d::ctl
