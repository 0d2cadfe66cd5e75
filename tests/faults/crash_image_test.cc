// Tests of power cuts at any moment of a take. After a cut, the disk holds all synced data, and
// what was reported as safe is whole. The images are made from a trace of the real programs
// (crash_image.h).
//
// There is at least one image of each prefix of a trace, with random losses of what was not synced.
// V3D_CRASH_IMAGES=N makes N images of each trace and mode; V3D_CRASH_SEED=N changes their seed.
#include "crash_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <sstream>

#include "base/io/file.h"
#include "daemon/node/take_folder.h"
#include "faulty_program.h"
#include "recorded_take.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;
using Lost = std::vector<std::string>;

unsigned long number_from(const char* variable, unsigned long usual) {
  const char* const text = std::getenv(variable);
  return text == nullptr ? usual : std::strtoul(text, nullptr, 10);
}

bool is_working_file(const std::string& file) {
  return fs::path(file).filename().string().starts_with(".");
}

/// Checks one image, made at the path `image` for a power cut before the change `count`.
using Check = std::function<Lost(const fs::path& image, size_t count)>;

class CrashImage : public testing::TestWithParam<CrashMode> {
 protected:
  std::string mode_name() const { return GetParam() == CrashMode::kOrdered ? "ordered" : "harsh"; }

  /// Checks the model: all changes of the trace together give the files that the programs made.
  void expect_right_model(const CrashModel& model) {
    const fs::path whole = folder_ / "whole";
    model.make_whole(whole);
    const Files made = contents_of(whole), real = contents_of(place_.disk());
    ASSERT_EQ(made.size(), real.size());
    for (const auto& [file, content] : real) {
      ASSERT_TRUE(made.contains(file)) << file;
      ASSERT_TRUE(made.at(file) == content) << file;
    }
  }

  /// The model of a disk on which record_driver runs these operations.
  CrashModel traced(const std::vector<std::string>& operations) {
    make_driven_studio(place_.disk());
    CrashModel model(place_.disk());
    for (const std::string& operation : operations) {
      const ProgramResult driven =
          place_.run_traced({V3D_RECORD_DRIVER, operation, place_.disk(), place_.marks()});
      EXPECT_EQ(driven.status, 0) << driven.err;
    }
    model.add(read_trace(place_.trace()));
    expect_right_model(model);
    return model;
  }

  void check_images(const std::string& what, const CrashModel& model, const Check& check) {
    std::mt19937 random(static_cast<unsigned>(number_from("V3D_CRASH_SEED", 1994)));
    const size_t prefixes = model.trace().size() + 1;
    const unsigned long images =
        std::max(number_from("V3D_CRASH_IMAGES", kImages), static_cast<unsigned long>(prefixes));
    int bad = 0;
    for (unsigned long i = 0; i < images; ++i) {
      const size_t count = i % prefixes;
      const fs::path image = folder_ / "image";
      model.make_image(image, count, GetParam(), random);
      const Lost lost = check(image, count);
      fs::remove_all(image);
      if (lost.empty()) continue;
      ++bad;
      if (bad > kShown) continue;
      std::string text;
      for (const std::string& line : lost) text += "\n  " + line;
      ADD_FAILURE() << what << ", " << mode_name() << ": image " << i << ", before change " << count
                    << " of " << model.trace().size() << text;
    }
    std::cout << what << ", " << mode_name() << ": " << images << " images of "
              << model.trace().size() << " changes, " << bad << " violations\n";
  }

  static constexpr unsigned long kImages = 170;
  static constexpr int kShown = 8;
  const TemporaryFolder folder_{"/dev/shm"};
  const FaultyWorkplace place_{folder_.path() / "traced"};
};

// --- recording ----------------------------------------------------------------------------------

/// Marks that the driver wrote, with their positions in the trace.
class Marks {
 public:
  explicit Marks(const CrashModel& model) : model_(model) {
    for (size_t at = 0; at < model.trace().size(); ++at) {
      if (model.trace()[at].change != Change::kMark) continue;
      std::istringstream words(model.trace()[at].bytes);
      Mark mark{.at = at, .what = {}, .camera = {}, .pulse = 0};
      words >> mark.what >> mark.camera >> mark.pulse;
      marks_.push_back(std::move(mark));
    }
  }

  bool has(const std::string& what, size_t count) const { return last(what, count) > 0; }

  /// Frames ("frame") or meshes ("mesh") that must survive a power cut before the change `count`:
  /// their bytes were synced, or the driver reported them as synced, or the take as recovered or
  /// complete.
  std::vector<std::pair<std::string, int64_t>> safe(const std::string& what, size_t count) const {
    const size_t guaranteed =
        std::max({last("synced", count), last("recovered", count), last("complete", count)});
    std::vector<std::pair<std::string, int64_t>> frames;
    for (const Mark& mark : marks_) {
      if (mark.what != what || mark.at >= count) continue;
      const bool is_safe =
          mark.at < guaranteed || model_.is_synced(write_before(mark.at, mark.camera), count);
      if (is_safe) frames.emplace_back(mark.camera, mark.pulse);
    }
    return frames;
  }

 private:
  struct Mark {
    size_t at;
    std::string what, camera;
    int64_t pulse;
  };

  /// Position of the last mark of this kind; 0 when there is none.
  size_t last(const std::string& what, size_t count) const {
    size_t at = 0;
    for (const Mark& mark : marks_) {
      if (mark.what == what && mark.at < count) at = mark.at;
    }
    return at;
  }

  size_t write_before(size_t at, const std::string& camera) const {
    while (at-- > 0) {
      const bool is_write = model_.trace()[at].change == Change::kWrite;
      if (is_write && model_.file_of(at).starts_with(camera + ".")) return at;
    }
    throw std::runtime_error("trace: a frame was acknowledged that was not written");
  }

  const CrashModel& model_;
  std::vector<Mark> marks_;
};

void expect_frame(const take::TakePaths& take, const std::string& camera, int64_t pulse,
                  ImageSize size, Lost& lost) {
  const std::string name = camera + ", pulse " + std::to_string(pulse);
  try {
    const auto frame = take::FrameLogReader(take.frames(camera)).read(pulse);
    const auto recorded = recorded_frame(camera, pulse, size).frame.image.bytes;
    if (!frame || frame->image.bytes != recorded) lost.push_back("lost: " + name);
  } catch (const std::exception& error) {
    lost.push_back("lost: " + name + ": " + error.what());
  }
}

/// Checks that no file of `before` has changed. .toml, .index and working files may change.
void expect_unchanged(const Files& before, const Files& now, Lost& lost) {
  for (const auto& [file, content] : before) {
    const auto found = now.find(file);
    const std::string name = fs::path(file).filename();
    if (is_working_file(file)) continue;
    if (found == now.end()) {
      lost.push_back("recovery removed " + file);
    } else if (found->second != content && !name.ends_with(".toml") && !name.ends_with(".index")) {
      lost.push_back("recovery changed " + file);
    }
  }
}

void expect_complete(const take::TakePaths& take, Lost& lost) {
  const take::Verification verified = verify_take(take);
  if (verified.info.state != take::TakeState::kComplete)
    lost.emplace_back("the take is no longer complete");
  if (!verified.ledger.complete()) lost.push_back("complete take: " + verified.ledger.verdict());
  for (const std::string& line : verified.disagreements) lost.push_back("complete take: " + line);
}

/// Recovers the takes of the image as a daemon does after a power cut. Returns what is lost, one
/// line each.
Lost check_recorded(const fs::path& image, const Marks& marks, ImageSize size, size_t count) {
  Lost lost;
  const Studio studio = driven_studio(image);
  const take::TakePaths take = node::take_paths(studio, kDrivenTake);
  const Files before = contents_of(image);
  try {
    const bool is_ready = marks.has("ready", count);
    if (is_ready) lost = missing_studio_copies(image);
    for (const node::RecoveredTake& found :
         node::recover_open_takes(studio, kDrivenNode, kDrivenCameras)) {
      if (is_ready && !found.ledger) lost.push_back("not recovered: " + found.line);
    }
    const Files recovered = contents_of(image);
    expect_unchanged(before, recovered, lost);
    for (const auto& [camera, pulse] : marks.safe("frame", count)) {
      expect_frame(take, camera, pulse, size, lost);
    }
    if (is_ready) {
      const bool was_open = load_take_info(take).state == take::TakeState::kRecovered;
      if (was_open && !recover_take(take).info.name.empty() && contents_of(image) != recovered) {
        lost.emplace_back("a second recovery changes the take");
      }
      verify_take(take);
    }
    if (marks.has("complete", count)) expect_complete(take, lost);
  } catch (const std::exception& error) {
    lost.push_back(std::string("exception: ") + error.what());
  }
  return lost;
}

TEST_P(CrashImage, keeps_every_synced_frame_of_a_recorded_take) {
  CrashModel model = traced({"record"});
  const Marks marks(model);
  check_images("record", model, [&](const fs::path& image, size_t count) {
    return check_recorded(image, marks, kDrivenSize, count);
  });
}

TEST_P(CrashImage, keeps_every_synced_frame_of_many_pages) {
  CrashModel model = traced({"record_large"});
  const Marks marks(model);
  check_images("record_large", model, [&](const fs::path& image, size_t count) {
    return check_recorded(image, marks, kLargeSize, count);
  });
}

TEST_P(CrashImage, keeps_every_synced_or_recovered_frame_of_a_take_with_a_restart) {
  CrashModel model = traced({"cut", "restart"});
  const Marks marks(model);
  check_images("restart", model, [&](const fs::path& image, size_t count) {
    return check_recorded(image, marks, kDrivenSize, count);
  });
}

// --- meshes -------------------------------------------------------------------------------------

constexpr int64_t kNextMesh = 1000;  ///< pulse of the mesh after the power cut

/// Continues the mesh file as v3d-recond does after a power cut. Once it was ready, this must be
/// possible, and every synced mesh must be there.
Lost check_meshes(const fs::path& image, const Marks& marks, size_t count) {
  if (!marks.has("ready", count)) return {};
  const fs::path file = node::take_paths(driven_studio(image), kDrivenTake).mesh();
  Lost lost;
  try {
    const std::string before = read_file(file);
    if (marks.has("closed", count) && take::MeshFileReader(file).index_was_rebuilt()) {
      lost.emplace_back("the index of a closed file is lost");
    }
    take::MeshFileWriter writer(file, take::LogOpening::kContinue);
    io::throw_if_failed(writer.append(kNextMesh, driven_mesh(kNextMesh)));
    io::throw_if_failed(writer.close());
    if (!read_file(file).starts_with(before)) lost.emplace_back("existing bytes were changed");
    auto expected = marks.safe("mesh", count);
    expected.emplace_back("mesh", kNextMesh);
    take::MeshFileReader meshes(file);
    for (const auto& [name, pulse] : expected) {
      if (io::value_or_throw(meshes.read(pulse)) == driven_mesh(pulse)) continue;
      lost.push_back("lost: mesh of pulse " + std::to_string(pulse));
    }
  } catch (const std::exception& error) {
    lost.push_back(std::string("exception: ") + error.what());
  }
  return lost;
}

TEST_P(CrashImage, keeps_every_synced_mesh_of_a_growing_file) {
  CrashModel model = traced({"mesh", "mesh_restart"});
  const Marks marks(model);
  check_images("mesh", model, [&](const fs::path& image, size_t count) {
    return check_meshes(image, marks, count);
  });
}

// --- keys ---------------------------------------------------------------------------------------

TEST_P(CrashImage, keeps_a_key_file_that_was_reported_as_made) {
  CrashModel model(place_.disk());
  const ProgramResult made =
      place_.run_traced({V3D_BIN "/v3dctl", "key", "node", "--out", place_.disk() / "node.key"});
  ASSERT_EQ(made.status, 0) << made.out << made.err;
  model.add(read_trace(place_.trace()));
  ASSERT_NO_FATAL_FAILURE(expect_right_model(model));
  check_images("key", model, [&](const fs::path& image, size_t count) {
    const bool is_over = count == model.trace().size();
    return !is_over || contents_of(image) == contents_of(place_.disk()) ? Lost()
                                                                        : Lost{"the key is lost"};
  });
}

// --- collecting and deleting --------------------------------------------------------------------

/// Checks that the folder `take` holds the files of `recorded`, or is absent if `must_exist` is
/// false.
Lost check_whole_or_absent(const fs::path& take, const Files& recorded, bool must_exist) {
  if (!fs::exists(take)) return must_exist ? Lost{"the take is missing"} : Lost();
  Lost lost;
  const Files files = contents_of(take);
  for (const auto& [file, content] : recorded) {
    const auto found = files.find(file);
    if (found == files.end() || found->second != content)
      lost.push_back("missing or changed: " + file);
  }
  try {
    for (const std::string& line : take::verify_take({take}).disagreements) lost.push_back(line);
  } catch (const std::exception& error) {
    lost.emplace_back(error.what());
  }
  return lost;
}

class CompleteTake : public CrashImage {
 protected:
  CompleteTake() {
    make_driven_studio(place_.disk());
    place_.run({V3D_RECORD_DRIVER, "record", place_.disk(), place_.marks()}, {});
    fs::remove(place_.marks());
    for (auto& [file, content] : contents_of(take_in(place_.disk()))) {
      if (!is_working_file(file)) recorded_[file] = content;
    }
  }
  static fs::path take_in(const fs::path& disk) {
    return driven_studio(disk).storage.takes / kDrivenTake;
  }

  Files recorded_;
};

TEST_P(CompleteTake, is_whole_or_absent_in_the_archive_after_a_collection) {
  CrashModel model(place_.disk());
  const ProgramResult collected =
      place_.run_traced({V3D_BIN "/v3dctl", "takes", "collect", "--to", place_.disk() / "archive",
                         "--from", "cap01=" + (place_.disk() / "takes").string()});
  ASSERT_EQ(collected.status, 0) << collected.out << collected.err;
  model.add(read_trace(place_.trace()));
  ASSERT_NO_FATAL_FAILURE(expect_right_model(model));
  Files data = recorded_;  // the collection writes its own ledger for the joined take
  std::erase_if(data, [](const auto& file) {
    return file.first == "take.toml" || file.first == "ledger.toml";
  });
  check_images("collect", model, [&](const fs::path& image, size_t count) {
    Lost lost = check_whole_or_absent(take_in(image), recorded_, true);
    const bool is_over = count == model.trace().size();
    const Lost archived = check_whole_or_absent(image / "archive" / kDrivenTake, data, is_over);
    for (const std::string& line : archived) lost.push_back("in the archive: " + line);
    return lost;
  });
}

TEST_P(CompleteTake, is_whole_or_absent_after_a_deletion) {
  ASSERT_EQ(place_.run({V3D_BIN "/v3dctl", "verify", take_in(place_.disk())}, {}).status, 0);
  CrashModel model(place_.disk());
  const ProgramResult deleted =
      place_.run_traced({V3D_BIN "/v3dctl", "takes", "delete", "--dir", place_.disk() / "takes",
                         kDrivenTake, "--no-copy", "--yes"});
  ASSERT_EQ(deleted.status, 0) << deleted.out << deleted.err;
  model.add(read_trace(place_.trace()));
  ASSERT_NO_FATAL_FAILURE(expect_right_model(model));
  check_images("delete", model, [&](const fs::path& image, size_t) {
    return check_whole_or_absent(take_in(image), recorded_, false);
  });
}

constexpr auto kModeName = [](const auto& mode) {
  return mode.param == CrashMode::kOrdered ? "ordered" : "harsh";
};
INSTANTIATE_TEST_SUITE_P(PowerCut, CrashImage,
                         testing::Values(CrashMode::kOrdered, CrashMode::kHarsh), kModeName);
INSTANTIATE_TEST_SUITE_P(PowerCut, CompleteTake,
                         testing::Values(CrashMode::kOrdered, CrashMode::kHarsh), kModeName);

}  // namespace
}  // namespace v3d::test
