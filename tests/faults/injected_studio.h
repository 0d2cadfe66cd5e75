// A small simulated studio with the real daemons, one of which gets a fault (fault_plan.h). The
// test program is linked with v3d_test_network.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "daemon/control/operator_client.h"
#include "faulty_program.h"
#include "mapped_report.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "take/take.h"

namespace v3d::test {

/// What the daemon with the fault does.
enum class DaemonOperation {
  kRecord,       ///< v3d-captured with the trigger and one camera starts, records a take and ends
  kRejoin,       ///< v3d-captured with one camera was killed in a take; it starts and records again
  kReconstruct,  ///< v3d-recond starts and reconstructs a take of three cameras live
};
/// At 8 Hz: a daemon that has just started is certain of the first pulse if one of its first frames
/// arrives within a period.
inline constexpr int64_t kInjectedPulses = 12;

/// Result of one run of the daemon.
struct DaemonRun {
  /// Exit status (-1: it did not end), log in `out`, replies and events in `err`, counts of calls.
  ProgramResult program;
  bool was_ready = false;     ///< it sent health
  bool ended_itself = false;  ///< it ended before it was asked to
  bool is_done = false;       ///< every command was answered "done" by every node
  control::Answer stopped;    ///< answer to the last command
  /// Frames, or meshes with kReconstruct, that its health and replies reported as written.
  int64_t acknowledged = 0;
};

/// One thread.
class InjectedStudio {
 public:
  /// Starts the simulator and the daemons without a fault, and learns the background. Throws
  /// std::runtime_error.
  explicit InjectedStudio(DaemonOperation operation);

  DaemonOperation operation() const { return operation_; }
  /// Runs the operation in an empty takes folder.
  DaemonRun run(const Fault& fault);
  /// Name, studio file and take of the daemon with the fault.
  const std::string& node() const { return node_; }
  const Studio& studio() const { return studio_; }
  take::TakePaths take() const;

 private:
  void write_studio_files();
  void start_simulator();
  void start_others();
  void learn_background();
  void start_injected(const std::vector<std::string>& variables);
  void record_until_killed();
  void record();
  void stop();
  void end_injected();
  control::Answer command(wire::CommandVerb verb, int64_t pulses = 0);
  void collect_reports();
  /// Polls until `condition` holds or the daemon has ended. False at timeout.
  bool await(const std::function<bool()>& condition, int seconds);
  wire::NodeState state_of(const std::string& node);

  const DaemonOperation operation_;
  const std::string node_;  ///< of the daemon with the fault
  const TemporaryFolder folder_{"/dev/shm"};
  const std::filesystem::path home_;  ///< folder of the studio file of that daemon
  Studio studio_;
  std::optional<ChildProcess> simulator_, injected_;
  std::vector<std::unique_ptr<ChildProcess>> others_;
  std::unique_ptr<control::OperatorClient> client_;
  std::map<std::string, wire::HealthMessage> health_;
  DaemonRun run_;
};

}  // namespace v3d::test
