// The ledger of a take in Python.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "base/core/error.h"
#include "bindings.h"
#include "take/ledger/ledger.h"

namespace v3d::python {
namespace {

using take::CameraLedger;
using take::Ledger;

// Bits of a state, v3d.PulseState.
constexpr uint8_t kMissing = 1, kDuplicate = 2, kSuspect = 4;

const CameraLedger& camera_of(const Ledger& ledger, const std::string& name) {
  for (const CameraLedger& camera : ledger.cameras) {
    if (camera.name == name) return camera;
  }
  throw InputError("ledger of " + ledger.take + ": no camera " + name);
}

/// The state of each commanded pulse in one camera.
std::vector<uint8_t> states_of(const Ledger& ledger, const CameraLedger& camera) {
  std::vector<uint8_t> states(static_cast<size_t>(ledger.commanded));
  const auto mark = [&](const std::vector<int64_t>& pulses, uint8_t state) {
    for (const int64_t pulse : pulses) {
      if (pulse >= 0 && pulse < ledger.commanded) states[static_cast<size_t>(pulse)] |= state;
    }
  };
  mark(camera.missing, kMissing);
  mark(camera.duplicate, kDuplicate);
  mark(camera.suspect, kSuspect);
  return states;
}

void bind_camera_ledger(py::module_& module) {
  py::class_<CameraLedger>(module, "CameraLedger", "The account of one camera.")
      .def_property_readonly("name", [](const CameraLedger& c) { return text_of(c.name); })
      .def_readonly("exposed", &CameraLedger::exposed)
      .def_readonly("received", &CameraLedger::received)
      .def_readonly("written", &CameraLedger::written)
      .def_readonly("published", &CameraLedger::published)
      .def_property_readonly(
          "missing", [](const CameraLedger& c) { return array_of(c.missing); },
          "Pulses without a frame.")
      .def_property_readonly(
          "duplicate", [](const CameraLedger& c) { return array_of(c.duplicate); },
          "Pulses with more than one frame.")
      .def_property_readonly(
          "suspect", [](const CameraLedger& c) { return array_of(c.suspect); },
          "Pulses whose frame may have a wrong number.");
}

}  // namespace

void bind_ledger(py::module_& module) {
  bind_camera_ledger(module);
  py::class_<Ledger>(module, "Ledger", "The account of pulses and frames of a take.")
      .def_property_readonly("take", [](const Ledger& l) { return text_of(l.take); })
      .def_readonly("commanded", &Ledger::commanded, "Number of commanded pulses.")
      .def_readonly("commanded_is_minimum", &Ledger::commanded_is_minimum)
      .def_readonly("sensed", &Ledger::sensed,
                    "Pulses that the sense line detected; None without a sense line.")
      .def_property_readonly(
          "unsensed", [](const Ledger& l) { return array_of(l.unsensed); },
          "Commanded pulses that it did not detect.")
      .def_property_readonly("complete", &Ledger::complete)
      .def_property_readonly("verdict", [](const Ledger& l) { return text_of(l.verdict()); })
      .def_property_readonly(
          "cameras",
          [](const Ledger& l) {
            py::dict cameras;
            for (const CameraLedger& camera : l.cameras) cameras[text_of(camera.name)] = camera;
            return cameras;
          },
          "The account of each camera by name.")
      .def(
          "states",
          [](const Ledger& l, const std::string& camera) {
            return array_of(states_of(l, camera_of(l, camera)));
          },
          py::arg("camera"),
          "The state of each commanded pulse in a camera: uint8, bits of PulseState.");
}

}  // namespace v3d::python
