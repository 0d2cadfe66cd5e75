// Tracked surfaces (motion.v3d) in Python.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <mutex>

#include "base/core/error.h"
#include "base/io/file.h"
#include "bindings.h"
#include "codec/motion_codec.h"

namespace v3d::python {

/// A motion file in memory.
class MotionFile {
 public:
  explicit MotionFile(const std::filesystem::path& path) : path_(path), bytes_(read_file(path)) {
    motion_ =
        codec::MotionReader::open({reinterpret_cast<const uint8_t*>(bytes_.data()), bytes_.size()});
    if (!motion_) {
      throw InputError(path.string() + ": is no motion file, or damaged: run v3dctl track again");
    }
  }
  MotionFile(const MotionFile&) = delete;
  MotionFile& operator=(const MotionFile&) = delete;

  const std::vector<codec::MotionSegmentInfo>& segments() const { return motion_->segments(); }
  const std::filesystem::path& path() const { return path_; }

  codec::MotionTemplate surface(size_t segment) {
    const std::lock_guard lock(mutex_);
    const codec::MotionTemplate* const surface = motion_->surface(segment);
    if (surface == nullptr) throw damaged("the template of segment " + std::to_string(segment));
    return *surface;
  }
  codec::MotionPulse decode(size_t segment, size_t index) {
    const std::lock_guard lock(mutex_);
    const codec::MotionPulse* const pulse = motion_->decode(segment, index);
    if (pulse == nullptr) {
      throw damaged("pulse " + std::to_string(segments()[segment].pulses[index]));
    }
    return *pulse;
  }

 private:
  InputError damaged(const std::string& part) const {
    return InputError(path_.string() + ": " + part + " is damaged: run v3dctl track again");
  }

  std::filesystem::path path_;
  std::string bytes_;
  std::mutex mutex_;
  std::optional<codec::MotionReader> motion_;  ///< of bytes_
};

py::object open_motion(const std::filesystem::path& file) {
  return py::cast(without_python([&] { return std::make_shared<MotionFile>(file); }));
}

namespace {

/// A run of pulses with the same triangles.
class Segment {
 public:
  Segment(std::shared_ptr<MotionFile> file, size_t number)
      : file_(std::move(file)), number_(number) {}

  const codec::MotionSegmentInfo& info() const { return file_->segments()[number_]; }
  const std::vector<int64_t>& pulses() const { return info().pulses; }
  codec::MotionTemplate surface() const { return file_->surface(number_); }

  /// Throws InputError for a pulse that the segment lacks.
  codec::MotionPulse read(int64_t pulse) const {
    const auto found = std::lower_bound(pulses().begin(), pulses().end(), pulse);
    if (found == pulses().end() || *found != pulse) {
      throw InputError(file_->path().string() + ": segment " + std::to_string(number_) +
                       " has no pulse " + std::to_string(pulse) + "; it has " +
                       std::to_string(pulses().front()) + " to " + std::to_string(pulses().back()));
    }
    return file_->decode(number_, static_cast<size_t>(found - pulses().begin()));
  }

  /// Positions of all pulses, [pulse][vertex][axis]. Throws InputError beyond kMaxTrajectories.
  std::vector<float> trajectories() const {
    const size_t each = 3 * info().vertices;
    if (each * pulses().size() * sizeof(float) > kMaxTrajectories) {
      throw InputError(file_->path().string() + ": segment " + std::to_string(number_) +
                       " has more than 8 GB of positions: read its pulses one by one");
    }
    std::vector<float> values;
    for (size_t index = 0; index < pulses().size(); ++index) {
      const codec::MotionPulse pulse = file_->decode(number_, index);
      for (const codec::VertexPosition& p : pulse.positions) {
        values.insert(values.end(), p.begin(), p.end());
      }
    }
    return values;
  }

 private:
  static constexpr size_t kMaxTrajectories = size_t{8} << 30;  // bytes

  std::shared_ptr<MotionFile> file_;
  size_t number_;
};

template <class Rows>
py::object colours_or_none(const Rows& colours, const py::object& self) {
  if (colours.empty()) return py::none();
  auto [data, shape] = triples<uint8_t>(colours);
  return view_of(data, std::move(shape), self);
}

template <class Surface>
py::array positions_of(const py::object& self) {
  auto [data, shape] = triples<float>(self.cast<const Surface&>().positions);
  return view_of(data, std::move(shape), self);
}

void bind_template(py::module_& module) {
  using codec::MotionTemplate;
  py::class_<MotionTemplate>(module, "Template",
                             "The surface of a segment at its key pulse. Its arrays are read-only.")
      .def_property_readonly("vertices", &positions_of<MotionTemplate>,
                             "float32 [vertices, 3]: world, metres, z up.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) {
            auto [data, shape] = triples<uint32_t>(self.cast<const MotionTemplate&>().triangles);
            return view_of(data, std::move(shape), self);
          },
          "uint32 [triangles, 3]: of all pulses, counter-clockwise seen from outside.")
      .def_property_readonly(
          "colours",
          [](const py::object& self) {
            return colours_or_none(self.cast<const MotionTemplate&>().colours, self);
          },
          "uint8 [vertices, 3]: sRGB; None without colours.");
}

void bind_pulse(py::module_& module) {
  using codec::MotionPulse;
  py::class_<MotionPulse>(module, "TrackedPulse",
                          "The vertices of a segment at one pulse. Its arrays are read-only.")
      .def_readonly("pulse", &MotionPulse::pulse)
      .def_property_readonly("vertices", &positions_of<MotionPulse>,
                             "float32 [vertices, 3]: world, metres, z up.")
      .def_property_readonly(
          "colours",
          [](const py::object& self) {
            return colours_or_none(self.cast<const MotionPulse&>().colours, self);
          },
          "uint8 [vertices, 3]: sRGB at this pulse; None without colours.")
      .def_property_readonly(
          "confidences",
          [](const py::object& self) -> py::object {
            const std::vector<uint8_t>& values = self.cast<const MotionPulse&>().confidences;
            if (values.empty()) return py::none();
            return view_of(values.data(), {std::ssize(values)}, self);
          },
          "uint8 [vertices]: 0, only predicted, to 255; None when not stated.");
}

void bind_segment(py::module_& module) {
  bind_iterator<Segment>(module, "SegmentIterator", [](Segment& segment, int64_t pulse) {
    return std::optional(segment.read(pulse));
  });
  using Pointer = std::shared_ptr<Segment>;
  py::class_<Segment, Pointer>(module, "Segment",
                               "A run of pulses whose surface has the same triangles.")
      .def_property_readonly("pulses", [](const Segment& s) { return array_of(s.pulses()); })
      .def_property_readonly(
          "key_pulse", [](const Segment& s) { return s.pulses()[s.info().key]; },
          "The pulse whose mesh became the template.")
      .def_property_readonly("vertex_count", [](const Segment& s) { return s.info().vertices; })
      .def_property_readonly("triangle_count", [](const Segment& s) { return s.info().triangles; })
      .def_property_readonly(
          "step_m", [](const Segment& s) { return s.info().step_m; },
          "Positions differ by at most half of it from those that were tracked, metres.")
      .def_property_readonly(
          "template", py::cpp_function(&Segment::surface, py::call_guard<py::gil_scoped_release>()))
      .def("read", &Segment::read, py::arg("pulse"), py::call_guard<py::gil_scoped_release>(),
           "The vertices at a pulse. Forward is fastest.")
      .def(
          "trajectories",
          [](const Segment& s) {
            return array_of(
                without_python([&] { return s.trajectories(); }),
                {std::ssize(s.pulses()), static_cast<py::ssize_t>(s.info().vertices), 3});
          },
          "float32 [pulses, vertices, 3]: the positions of all pulses.")
      .def("__len__", [](const Segment& s) { return s.pulses().size(); })
      .def("__iter__", [](const Pointer& s) { return PulseIterator<Segment>{s}; });
}

}  // namespace

void bind_motion(py::module_& module) {
  bind_template(module);
  bind_pulse(module);
  bind_segment(module);
  using File = std::shared_ptr<MotionFile>;
  py::class_<MotionFile, File>(module, "Motion", "Tracked surfaces: the segments of a motion file.")
      .def(py::init<std::filesystem::path>(), py::arg("path"),
           py::call_guard<py::gil_scoped_release>(), "Opens a motion file.")
      .def_property_readonly("segments", [](const File& file) {
        std::vector<std::shared_ptr<Segment>> segments;
        for (size_t s = 0; s < file->segments().size(); ++s) {
          segments.push_back(std::make_shared<Segment>(file, s));
        }
        return segments;
      });
}

}  // namespace v3d::python
