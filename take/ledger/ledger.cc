#include "take/ledger/ledger.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <iterator>
#include <tuple>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "take/take.h"
#include "take/take_files.h"

namespace v3d::take {
namespace {

/// Appends the numbers from `first` to `last` that differ by `step`, of which `last` is one; none
/// if `first` > `last`.
void append_run(int64_t first, int64_t last, int64_t step, std::vector<int64_t>& numbers) {
  if (first > last) return;
  for (; first < last; first += step) numbers.push_back(first);
  numbers.push_back(last);
}

void append_run(int64_t first, int64_t last, std::vector<int64_t>& numbers) {
  append_run(first, last, 1, numbers);
}

/// Index of the last number of the run from index `first` whose numbers differ by `step`.
size_t end_of_run(const std::vector<int64_t>& numbers, size_t first, uint64_t step) {
  const auto difference = [&](size_t i) {  // of any two numbers: a damaged label can be any number
    return static_cast<uint64_t>(numbers[i + 1]) - static_cast<uint64_t>(numbers[i]);
  };
  while (first + 1 < numbers.size() && difference(first) == step) ++first;
  return first;
}

/// The difference of the number at index `first` to the next one. 1 when it has none, or one that
/// no regular loss has.
int64_t step_from(const std::vector<int64_t>& numbers, size_t first) {
  if (first + 1 == numbers.size()) return 1;
  const uint64_t step =
      static_cast<uint64_t>(numbers[first + 1]) - static_cast<uint64_t>(numbers[first]);
  const bool is_regular = step >= 1 && step <= static_cast<uint64_t>(kMaxPulses);
  return is_regular ? static_cast<int64_t>(step) : 1;
}

/// Calls `visit(first, last)` for each run of consecutive numbers. `numbers` ascend.
template <class Visit>
void for_each_run(const std::vector<int64_t>& numbers, Visit visit) {
  for (size_t first = 0, last = 0; first < numbers.size(); first = last + 1) {
    last = end_of_run(numbers, first, 1);
    visit(numbers[first], numbers[last]);
  }
}

/// Calls `visit(first, last, step)` for each run of numbers with a constant difference, such as
/// every second pulse. `numbers` ascend.
template <class Visit>
void for_each_stepped_run(const std::vector<int64_t>& numbers, Visit visit) {
  for (size_t first = 0, last = 0; first < numbers.size(); first = last + 1) {
    const int64_t step = step_from(numbers, first);
    last = end_of_run(numbers, first, static_cast<uint64_t>(step));
    visit(numbers[first], numbers[last], step);
  }
}

int64_t read_count(const TomlTable& table, std::string_view key) {
  const int64_t n = table.integer(key);
  if (n < 0 || n > kMaxPulses) {
    table.fail(key, "expected a count, 0 to " + format_count(kMaxPulses));
  }
  return n;
}

// The forms of a list of numbers. `key`: all numbers; `key` + "_runs": first and last number of
// each run of consecutive numbers; `key` + "_steps": first number, last number and difference of
// each run of numbers with a constant difference.
constexpr std::string_view kRunsSuffix = "_runs", kStepsSuffix = "_steps";

/// The numbers of runs: the field `key` has `width` values of each, with a difference if there are
/// three.
std::vector<int64_t> read_runs(const TomlTable& table, const std::string& key, size_t width) {
  const std::vector<int64_t> runs = table.integers(key);
  if (runs.size() % width != 0) {
    table.fail(key, width == 2 ? "expected pairs of a first and a last number"
                               : "expected a first number, a last number and a difference");
  }
  std::vector<int64_t> numbers;
  for (size_t i = 0; i < runs.size(); i += width) {
    const int64_t first = runs[i], last = runs[i + 1], step = width == 3 ? runs[i + 2] : 1;
    const auto room = static_cast<uint64_t>(kMaxPulses - std::ssize(numbers));
    const uint64_t length = static_cast<uint64_t>(last) - static_cast<uint64_t>(first);
    if (last < first || step < 1 || length % static_cast<uint64_t>(step) != 0 ||
        length / static_cast<uint64_t>(step) >= room) {
      table.fail(key,
                 "expected ascending runs of at most " + format_count(kMaxPulses) + " numbers");
    }
    append_run(first, last, step, numbers);
  }
  return numbers;
}

/// The numbers of the field `key` in any form. Empty where the table has none.
std::vector<int64_t> read_numbers(const TomlTable& table, std::string_view key) {
  const std::string runs_key = std::string(key).append(kRunsSuffix);
  const std::string steps_key = std::string(key).append(kStepsSuffix);
  if (table.has(key)) return table.integers(key);
  if (table.has(runs_key)) return read_runs(table, runs_key, 2);
  return table.has(steps_key) ? read_runs(table, steps_key, 3) : std::vector<int64_t>();
}

/// Like read_numbers() for a field that every ledger has in one of its forms.
std::vector<int64_t> read_required_numbers(const TomlTable& table, const std::string& key) {
  const bool is_there = table.has(key) || table.has(key + std::string(kRunsSuffix)) ||
                        table.has(key + std::string(kStepsSuffix));
  return is_there ? read_numbers(table, key) : table.integers(key);
}

/// Long lists are written in their shortest form: a node that left a take of hours misses every
/// later pulse, and a camera at half the rate misses every second one. Short lists are not, so that
/// earlier versions read all other ledgers.
void write_numbers(const std::string& key, const std::vector<int64_t>& numbers,
                   TomlWriter& ledger) {
  constexpr size_t kMaxListed = 1000;
  if (numbers.size() <= kMaxListed) {
    ledger.integers(key, numbers);
    return;
  }
  std::vector<int64_t> runs, stepped;
  for_each_run(numbers, [&](int64_t first, int64_t last) {
    runs.insert(runs.end(), {first, last});
  });
  for_each_stepped_run(numbers, [&](int64_t first, int64_t last, int64_t step) {
    stepped.insert(stepped.end(), {first, last, step});
  });
  if (stepped.size() < std::min(runs.size(), numbers.size())) {
    ledger.integers(key + std::string(kStepsSuffix), stepped);
  } else if (runs.size() < numbers.size()) {
    ledger.integers(key + std::string(kRunsSuffix), runs);
  } else {
    ledger.integers(key, numbers);
  }
}

/// Adds the pulses from `counted` to `commanded`, which the camera's node did not count, as
/// missing. Omits pulses with a suspect frame. Adds nothing above kMaxPulses, which no take has.
void add_missing(CameraLedger& camera, int64_t counted, int64_t commanded) {
  if (commanded > kMaxPulses) return;
  const std::set<int64_t> recorded(camera.suspect.begin(), camera.suspect.end());
  for (int64_t pulse = std::max<int64_t>(counted, 0); pulse < commanded; ++pulse) {
    if (!recorded.contains(pulse)) camera.missing.push_back(pulse);
  }
}

/// The account of the sense line, greater where the node sensed more pulses. Nodes with the same
/// counts are ordered by their lists, so that the order of the nodes has no effect on merge().
auto sense_line(const Ledger& part) { return std::tie(part.sensed, part.commanded, part.unsensed); }

std::vector<int64_t> union_of(const std::vector<int64_t>& a, const std::vector<int64_t>& b) {
  std::vector<int64_t> numbers;
  std::ranges::set_union(a, b, std::back_inserter(numbers));
  return numbers;
}

CameraLedger read_camera(const TomlTable& table) {
  CameraLedger camera;
  camera.name = table.text("name");
  camera.received = read_count(table, "received");
  camera.exposed = table.has("exposed") ? read_count(table, "exposed") : camera.received;
  camera.written = read_count(table, "written");
  camera.published = read_count(table, "published");
  camera.missing = read_required_numbers(table, "missing");
  camera.duplicate = read_required_numbers(table, "duplicate");
  camera.suspect = read_required_numbers(table, "suspect");
  table.reject_unknown_fields();
  return camera;
}

TakeFile read_file_entry(const TomlTable& table) {
  TakeFile file;
  file.name = table.text("name");
  file.bytes = table.integer("bytes");
  if (file.bytes < 0) table.fail("bytes", "expected a length, 0 or more");
  if (table.has("xxh3")) {
    file.checksum = parse_checksum(table.text("xxh3"));
    if (!file.checksum) table.fail("xxh3", "expected 16 hexadecimal digits");
  }
  table.reject_unknown_fields();
  return file;
}

void write_file_entry(const TakeFile& file, TomlWriter& ledger) {
  ledger.element("file").text("name", file.name).integer("bytes", file.bytes);
  if (file.checksum) ledger.text("xxh3", checksum_text(*file.checksum));
}

void write_camera(const CameraLedger& camera, TomlWriter& ledger) {
  ledger.element("camera")
      .text("name", camera.name)
      .integer("exposed", camera.exposed)
      .integer("received", camera.received)
      .integer("written", camera.written)
      .integer("published", camera.published);
  write_numbers("missing", camera.missing, ledger);
  write_numbers("duplicate", camera.duplicate, ledger);
  write_numbers("suspect", camera.suspect, ledger);
}

}  // namespace

bool Ledger::complete() const {
  return !cameras.empty() && commanded > 0 && !commanded_is_minimum &&
         sensed.value_or(commanded) == commanded && unsensed.empty() && extra == 0 &&
         runt.empty() && absent_nodes.empty() &&
         std::all_of(cameras.begin(), cameras.end(), [&](const CameraLedger& c) {
           return c.written == commanded && c.missing.empty() && c.duplicate.empty() &&
                  c.suspect.empty();
         });
}

std::string Ledger::verdict() const {
  size_t missing = 0;
  size_t duplicate = 0;
  size_t suspect = 0;
  for (const CameraLedger& c : cameras) {
    missing += c.missing.size();
    duplicate += c.duplicate.size();
    suspect += c.suspect.size();
  }
  const auto count = [](size_t n) { return format_count(static_cast<int64_t>(n)); };
  std::string text = "take " + take + ": " + (complete() ? "complete" : "incomplete") + ", " +
                     count(cameras.size()) + " cameras x " +
                     (commanded_is_minimum ? "at least " : "") + format_count(commanded) +
                     " pulses, " + count(missing) + " missing, " + count(suspect) + " suspect";
  if (duplicate > 0) text += ", " + count(duplicate) + " duplicate";
  if (!sensed) text += ", pulses not sensed";
  if (sensed && *sensed != commanded) text += ", " + format_count(*sensed) + " pulses sensed";
  if (extra > 0) text += ", " + format_count(extra) + " extra pulses";
  if (!runt.empty()) text += ", " + count(runt.size()) + " runt pulses";
  if (!absent_nodes.empty()) text += ", without " + text_of(absent_nodes);
  return text;
}

const TakeFile* Ledger::file(std::string_view name) const {
  const auto found = std::ranges::find(files, name, &TakeFile::name);
  return found == files.end() ? nullptr : &*found;
}

void CameraAccount::add(int64_t pulse, bool suspect) {
  ++frames_;
  if (!seen_.insert(pulse)) duplicate_.insert(pulse);
  if (suspect) suspect_.insert(pulse);
}

CameraLedger CameraAccount::ledger(const std::string& camera, int64_t commanded) const {
  CameraLedger ledger;
  ledger.name = camera;
  ledger.exposed = ledger.received = ledger.written = frames_;
  ledger.missing = seen_.missing(commanded);
  ledger.duplicate.assign(duplicate_.begin(), duplicate_.end());
  std::set<int64_t> suspect = suspect_;
  for (const int64_t pulse : seen_.outside(commanded)) suspect.insert(pulse);
  ledger.suspect.assign(suspect.begin(), suspect.end());
  return ledger;
}

CameraLedger account(const std::string& camera, const std::vector<int64_t>& pulses,
                     const std::vector<int64_t>& suspect, int64_t commanded) {
  const std::set<int64_t> suspect_set(suspect.begin(), suspect.end());
  CameraAccount account;
  for (const int64_t pulse : pulses) account.add(pulse, suspect_set.contains(pulse));
  return account.ledger(camera, commanded);
}

Ledger merge(const std::vector<Ledger>& parts) {
  Ledger whole;
  if (const auto most = std::ranges::max_element(parts, {}, sense_line); most != parts.end()) {
    whole.sensed = most->sensed;
    whole.unsensed = most->unsensed;
  }
  for (const Ledger& part : parts) whole.commanded = std::max(whole.commanded, part.commanded);
  whole.commanded_is_minimum = std::ranges::all_of(parts, [&](const Ledger& part) {
    return part.commanded < whole.commanded || part.commanded_is_minimum;
  });
  for (const Ledger& part : parts) {
    whole.take = part.take;
    whole.extra = std::max(whole.extra, part.extra);
    whole.runt = union_of(whole.runt, part.runt);
    for (CameraLedger camera : part.cameras) {
      add_missing(camera, part.commanded, whole.commanded);
      whole.cameras.push_back(std::move(camera));
    }
    whole.sounds.insert(whole.sounds.end(), part.sounds.begin(), part.sounds.end());
    std::ranges::copy(part.nodes_without_sound, std::back_inserter(whole.nodes_without_sound));
  }
  return whole;
}

std::string number_ranges(const std::vector<int64_t>& numbers) {
  constexpr int kMaxRanges = 24;
  constexpr size_t kMinStepped = 5;  // "1, 3, 5" is easier to read than "1-5 by 2"
  std::string text;
  int ranges = 0;
  for (size_t first = 0, last = 0; first < numbers.size(); first = last + 1) {
    if (++ranges > kMaxRanges) {
      return text + ", ... (" + format_count(std::ssize(numbers)) + " in all; --json lists them)";
    }
    const int64_t step = step_from(numbers, first);
    last = end_of_run(numbers, first, static_cast<uint64_t>(step));
    if (step > 1 && last - first + 1 < kMinStepped) last = first;
    text += (text.empty() ? "" : ", ") + std::to_string(numbers[first]);
    if (last == first) continue;
    text += "-" + std::to_string(numbers[last]);
    if (step > 1) text += " by " + std::to_string(step);
  }
  return text;
}

std::vector<std::string> problem_lines(const Ledger& ledger) {
  std::vector<std::string> lines;
  const auto add_line = [&](const std::string& who, const char* what,
                            const std::vector<int64_t>& pulses) {
    if (!pulses.empty()) lines.push_back(who + ": " + what + " " + number_ranges(pulses));
  };
  for (const TakeNode& node : ledger.absent_nodes) {
    lines.push_back("not in this copy: " + text_of({node}));
  }
  add_line("sense line", "missing pulses", ledger.unsensed);
  add_line("sense line", "runt pulses", ledger.runt);
  for (const CameraLedger& camera : ledger.cameras) {
    add_line(camera.name, "missing pulses", camera.missing);
    add_line(camera.name, "duplicate frames of pulses", camera.duplicate);
    add_line(camera.name, "suspect pulses", camera.suspect);
  }
  for (const SoundLedger& sound : ledger.sounds) {
    if (const std::string line = problem_line(sound); !line.empty()) lines.push_back(line);
  }
  for (const std::string& node : ledger.nodes_without_sound) {
    lines.push_back("sound of " + node + ": nothing was recorded");
  }
  return lines;
}

std::vector<std::string> table_lines(const Ledger& ledger) {
  size_t width = 6;
  for (const CameraLedger& camera : ledger.cameras) width = std::max(width, camera.name.size());
  const auto line = [&](std::string name, const std::array<std::string, 4>& cells) {
    name.resize(width, ' ');
    for (const std::string& cell : cells) {
      name += std::string(cell.size() < 11 ? 11 - cell.size() : 1, ' ') + cell;
    }
    return name;
  };
  std::vector<std::string> lines = {
      line("camera", {"exposed", "received", "written", "published"})};
  for (const CameraLedger& c : ledger.cameras) {
    lines.push_back(line(c.name, {format_count(c.exposed), format_count(c.received),
                                  format_count(c.written), format_count(c.published)}));
  }
  const std::string sensed =
      ledger.sensed ? format_count(*ledger.sensed) + " sensed" : "not sensed";
  lines.push_back((ledger.commanded_is_minimum ? "at least " : "") +
                  format_count(ledger.commanded) + " pulses commanded, " + sensed);
  return lines;
}

Ledger load_ledger(const std::filesystem::path& path) {
  if (!file_exists(path)) {
    throw InputError(
        path.string() +
        ": missing; the take was not closed; v3dctl verify counts its frames from the logs");
  }
  return parse_ledger(
      io::value_or_throw(io::read_file(path, kMaxLedgerBytes, io::OpenMode::kReadWithinFolder)),
      path);
}

Ledger parse_ledger(std::string_view text, const std::filesystem::path& path) {
  const TomlTable table = parse_checksummed(text, path);
  Ledger ledger;
  ledger.take = table.text("take");
  ledger.commanded = read_count(table, "commanded");
  ledger.commanded_is_minimum = table.boolean_or("commanded_is_minimum", false);
  if (table.boolean_or("sense_line", true)) ledger.sensed = read_count(table, "sensed");
  ledger.unsensed = read_numbers(table, "unsensed");
  if (table.has("extra")) ledger.extra = read_count(table, "extra");
  ledger.runt = read_numbers(table, "runt");
  for (const TomlTable& camera : table.tables("camera")) {
    ledger.cameras.push_back(read_camera(camera));
  }
  for (const TomlTable& sound : table.tables("sound")) {
    ledger.sounds.push_back(read_sound_ledger(sound));
  }
  ledger.absent_nodes = read_nodes(table, "absent_node");
  for (const TomlTable& file : table.tables("file")) ledger.files.push_back(read_file_entry(file));
  table.reject_unknown_fields();
  return ledger;
}

io::Status save_ledger(const std::filesystem::path& path, const Ledger& ledger) {
  TomlWriter file;
  file.text("take", ledger.take).integer("commanded", ledger.commanded);
  if (ledger.commanded_is_minimum) file.boolean("commanded_is_minimum", true);
  file.boolean("sense_line", ledger.sensed.has_value());
  if (ledger.sensed) {
    file.integer("sensed", *ledger.sensed);
    write_numbers("unsensed", ledger.unsensed, file);
    file.integer("extra", ledger.extra);
    write_numbers("runt", ledger.runt, file);
  }
  for (const CameraLedger& camera : ledger.cameras) write_camera(camera, file);
  for (const SoundLedger& sound : ledger.sounds) write_sound_ledger(sound, file);
  for (const TakeNode& node : ledger.absent_nodes) write_node("absent_node", node, file);
  for (const TakeFile& entry : ledger.files) write_file_entry(entry, file);
  const std::string text = with_checksum(file.written());
  if (text.size() > kMaxLedgerBytes) {
    return io::io_error("write", path,
                        "the ledger has " + format_count(std::ssize(text)) +
                            " bytes; expected at most " + format_count(int64_t{kMaxLedgerBytes}),
                        EFBIG);
  }
  return io::replace_file(path, text);
}

bool PulseSet::contains(int64_t pulse) const {
  const auto next_run = runs_.upper_bound(pulse);
  return next_run != runs_.begin() && pulse <= std::prev(next_run)->second;
}

bool PulseSet::insert(int64_t pulse) {
  if (contains(pulse)) return false;
  ++size_;
  const auto next_run = runs_.upper_bound(pulse);
  const bool joins_next = next_run != runs_.end() && next_run->first - 1 == pulse;
  const int64_t last = joins_next ? next_run->second : pulse;
  const bool joins_previous = next_run != runs_.begin() && std::prev(next_run)->second + 1 == pulse;
  if (joins_previous) {
    std::prev(next_run)->second = last;
  } else {
    runs_.emplace(pulse, last);
  }
  if (joins_next) runs_.erase(next_run);
  return true;
}

std::vector<int64_t> PulseSet::all() const {
  std::vector<int64_t> all;
  all.reserve(static_cast<size_t>(size_));
  for (const auto& [first, last] : runs_) append_run(first, last, all);
  return all;
}

std::vector<int64_t> PulseSet::outside(int64_t commanded) const {
  std::vector<int64_t> outside;
  for (const auto& [first, last] : runs_) {
    append_run(first, std::min<int64_t>(last, -1), outside);
    append_run(std::max(first, commanded), last, outside);
  }
  return outside;
}

std::vector<int64_t> PulseSet::missing(int64_t commanded) const {
  std::vector<int64_t> missing;
  int64_t next = 0;
  const auto append_missing_until = [&](int64_t end) {
    for (; next < end; ++next) missing.push_back(next);
  };
  for (const auto& [first, last] : runs_) {
    append_missing_until(std::min(first, commanded));
    if (last >= commanded) return missing;
    next = std::max(next, last + 1);
  }
  append_missing_until(commanded);
  return missing;
}

}  // namespace v3d::take
