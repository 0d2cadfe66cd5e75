// Recorded frames of a camera in Python.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <mutex>
#include <unordered_set>
#include <variant>

#include "base/core/error.h"
#include "base/image/colour.h"
#include "base/image/frame.h"
#include "bindings.h"
#include "daemon/recorded/take_frames.h"
#include "recon/texture/undistortion.h"
#include "take/logs/frame_log.h"

namespace v3d::python {

/// A frame that was read.
struct RecordedFrame {
  std::shared_ptr<const RigCamera> camera;
  Frame raw;
  std::optional<Mask> mask;

  Image rgb(bool corrected) const {
    Image image = to_rgb(raw.image.view());
    if (corrected && !camera->colour.is_identity()) correct(image, camera->colour);
    return image;
  }
  /// Throws InputError for a frame of another size than the calibration.
  recon::MaskedImage undistorted(bool corrected) const {
    const CameraModel& model = camera->model;
    check_size(raw.image.size);
    if (mask) check_size(mask->size());
    return recon::undistorted({rgb(corrected), mask.value_or(Mask(model.size()))}, model,
                              recon::pinhole_of(model, camera->name));
  }

 private:
  void check_size(ImageSize size) const {
    if (size == camera->model.size()) return;
    throw InputError("pulse " + std::to_string(raw.label.pulse) + " of " + camera->name +
                     ": the frame is " + format_size(size) + ", but the calibration is for " +
                     format_size(camera->model.size()));
  }
};

/// Reader of the frames of one camera in a range of pulses.
class CameraFrames {
 public:
  CameraFrames(const take::TakePaths& paths, const RigCamera& camera, take::FrameRange range,
               bool masks)
      : camera_(std::make_shared<const RigCamera>(camera)) {
    if (masks) {
      log_.emplace<recorded::SegmentedLog>(paths, camera.name);
    } else {
      log_.emplace<take::FrameLogReader>(paths.frames(camera.name));
    }
    std::unordered_set<int64_t> known;
    for (const FrameLabel& label : labels()) {
      if (range.contains(label.pulse) && known.insert(label.pulse).second) {
        pulses_.push_back(label.pulse);
      }
    }
  }

  const RigCamera& camera() const { return *camera_; }
  /// In the order of the log, each once.
  const std::vector<int64_t>& pulses() const { return pulses_; }

  std::optional<RecordedFrame> read(int64_t pulse) {
    const std::lock_guard lock(mutex_);
    if (auto* const segmented = std::get_if<recorded::SegmentedLog>(&log_)) {
      auto frame = segmented->read(pulse);
      if (!frame) return std::nullopt;
      return RecordedFrame{camera_, std::move(frame->raw), std::move(frame->mask)};
    }
    auto frame = std::get<take::FrameLogReader>(log_).read(pulse);
    if (!frame) return std::nullopt;
    return RecordedFrame{camera_, *std::move(frame), std::nullopt};
  }

  std::vector<std::string> read_errors() {
    const std::lock_guard lock(mutex_);
    return std::visit(
        [](const auto& log) {
          if constexpr (std::is_same_v<decltype(log), const std::monostate&>) {
            return std::vector<std::string>{};
          } else {
            return log.read_errors();
          }
        },
        std::as_const(log_));
  }

 private:
  const std::vector<FrameLabel>& labels() const {
    if (const auto* const segmented = std::get_if<recorded::SegmentedLog>(&log_)) {
      return segmented->labels();
    }
    return std::get<take::FrameLogReader>(log_).labels();
  }

  std::shared_ptr<const RigCamera> camera_;
  std::mutex mutex_;
  std::variant<std::monostate, take::FrameLogReader, recorded::SegmentedLog> log_;
  std::vector<int64_t> pulses_;
};

py::object open_frames(const take::TakePaths& paths, const RigCamera& camera,
                       take::FrameRange range, bool masks) {
  return py::cast(
      without_python([&] { return std::make_shared<CameraFrames>(paths, camera, range, masks); }));
}

py::array array_of(const Mask& mask) {
  const ImageSize size = mask.size();
  py::array_t<bool> array({size.height, size.width});
  bool* pixel = array.mutable_data();
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) *pixel++ = mask.get(x, y);
  }
  return array;
}

namespace {

void bind_frame(py::module_& module) {
  py::class_<RecordedFrame, std::shared_ptr<RecordedFrame>>(module, "Frame",
                                                            "The image of one camera at one pulse.")
      .def_property_readonly("camera", [](const RecordedFrame& f) { return *f.camera; })
      .def_property_readonly("pulse", [](const RecordedFrame& f) { return f.raw.label.pulse; })
      .def_property_readonly(
          "suspect", [](const RecordedFrame& f) { return f.raw.label.suspect; },
          "True when time stamp and frame counter disagree about the pulse.")
      .def_property_readonly(
          "camera_counter", [](const RecordedFrame& f) { return f.raw.label.camera_counter; },
          "Frame number of the camera.")
      .def_property_readonly(
          "device_time_ns",
          [](const RecordedFrame& f) { return f.raw.label.device_time.time_since_epoch().count(); },
          "Start of exposure on the camera's clock, nanoseconds.")
      .def_property_readonly(
          "received_ns",
          [](const RecordedFrame& f) { return f.raw.label.received.time_since_epoch().count(); },
          "When the last byte arrived at the host, nanoseconds since 1970.")
      .def_property_readonly(
          "pixel_format",
          [](const RecordedFrame& f) { return py::str(std::string(name(f.raw.image.format))); },
          "GenICam's name: 'Mono8', 'BayerRG8', ..., 'RGB8'.")
      .def_property_readonly(
          "raw",
          [](const py::object& self) {
            const Image& image = self.cast<const RecordedFrame&>().raw.image;
            return view_of(image.bytes.data(), shape_of(image), self);
          },
          "The recorded samples, of 10 and 12 bits the upper 8, uint8: [height, width], of RGB8 "
          "[height, width, 3]. Read-only, no copy.")
      .def(
          "rgb",
          [](const RecordedFrame& f, bool corrected) {
            return array_of(without_python([&] { return f.rgb(corrected); }));
          },
          py::kw_only(), py::arg("corrected") = false,
          "The demosaiced image, uint8 [height, width, 3]. `corrected`: with the colour response "
          "of calib.toml.")
      .def(
          "undistorted",
          [](const RecordedFrame& f, bool corrected) {
            return array_of(without_python([&] { return f.undistorted(corrected).image; }));
          },
          py::kw_only(), py::arg("corrected") = false,
          "The demosaiced image as camera.pinhole() would have seen it; black where the lens saw "
          "nothing.")
      .def_property_readonly(
          "mask",
          [](const RecordedFrame& f) -> py::object {
            if (!f.mask) return py::none();
            return array_of(*f.mask);
          },
          "The silhouette, bool [height, width]; None unless the frames were opened with masks.")
      .def(
          "undistorted_mask",
          [](const RecordedFrame& f) -> py::object {
            if (!f.mask) return py::none();
            return array_of(without_python([&] { return f.undistorted(false).mask; }));
          },
          "The silhouette as camera.pinhole() would have seen it; None as `mask`.")
      .def("__repr__", [](const RecordedFrame& f) {
        return text_of("<v3d.Frame " + f.camera->name + ", pulse " +
                       std::to_string(f.raw.label.pulse) + ">");
      });
}

}  // namespace

void bind_frames(py::module_& module) {
  bind_frame(module);
  using Frames = std::shared_ptr<CameraFrames>;
  bind_iterator<CameraFrames>(module, "FrameIterator", [](CameraFrames& frames, int64_t pulse) {
    return frames.read(pulse);
  });
  py::class_<CameraFrames, Frames>(module, "Frames",
                                   "The frames of one camera. Iteration yields those that can be "
                                   "read, in the order of the log.")
      .def_property_readonly("camera", &CameraFrames::camera, py::return_value_policy::copy)
      .def_property_readonly(
          "pulses", [](const CameraFrames& f) { return array_of(f.pulses()); },
          "Pulses of the frames, in the order of the log, each once.")
      .def(
          "read", [](CameraFrames& f, int64_t pulse) { return f.read(pulse); }, py::arg("pulse"),
          py::call_guard<py::gil_scoped_release>(),
          "The frame of a pulse; None when there is none, or it is damaged or cannot be read.")
      .def_property_readonly(
          "read_errors",
          [](CameraFrames& f) {
            py::list errors;
            for (const std::string& error : without_python([&] { return f.read_errors(); })) {
              errors.append(text_of(error));
            }
            return errors;
          },
          "Errors of the disk so far, with path and cause.")
      .def("__len__", [](const CameraFrames& f) { return f.pulses().size(); })
      .def("__iter__", [](const Frames& f) { return PulseIterator<CameraFrames>{f}; });
}

}  // namespace v3d::python
