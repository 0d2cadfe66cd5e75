// Tasks of a reconstruction in pieces, wherever they run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace v3d::ctl {

/// Pieces of a take by their place in its list: begin <= n < end. A task passes over those that are
/// finished.
struct Task {
  int64_t begin = 0;
  int64_t end = 0;
};

/// One thread. Nothing of it runs any more when it is destroyed.
class TaskRunner {
 public:
  virtual ~TaskRunner() = default;

  /// Begins tasks for the missing pieces, given as places of `count` pieces, rising and not empty.
  /// Requires that none runs. Throws InputError where that is refused for good.
  virtual void start(const std::vector<int64_t>& missing, int64_t count) = 0;
  /// False when all tasks have ended, well or not. Called over and over; waits a little itself.
  virtual bool runs() = 0;
  /// Ends all tasks, and waits for that.
  virtual void cancel() = 0;
  /// Whom to ask when a task failed and left no log.
  virtual std::string hint() const = 0;
};

/// The words that do one task: this program's own, hidden command. `range`: "A:B".
std::vector<std::string> task_words(const std::string& folder, const std::string& range,
                                    int threads);

}  // namespace v3d::ctl
