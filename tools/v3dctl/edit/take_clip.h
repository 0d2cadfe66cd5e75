// Actions of takes: read for editing, written as takes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "recon/editing/clip.h"

namespace v3d::ctl {

struct TakeClip {
  recon::Clip clip;
  bool has_prop = false;
  recon::BodyLengths lengths{0, 0};  ///< learnt; of the first of spliced takes
  /// Pulses from the first to the last mesh of the take that are in no tracked segment with a skin.
  int64_t left_out = 0;
};

/// Reads the tracked surface of a take, learns its skeleton and skin (learn_skeleton()). Lost
/// pulses inside a tracked segment are interpolated, so that the action keeps its speed. Calls
/// `on_begin` with the number of pulses and `on_pulse` after each. Throws InputError for a take
/// without a tracked surface; std::runtime_error after an interrupt.
TakeClip read_clip(const std::filesystem::path& take, const std::function<void(int64_t)>& on_begin,
                   const std::function<void()>& on_pulse);

/// Throws InputError for a folder whose name cannot name a take, or that holds something else than
/// an edited take.
void check_output(const std::filesystem::path& out);

/// Writes a take of its own: take.toml, calib.toml of `source`, motion.v3d, skeleton.json and
/// edit.json with the text `edits`. Pulses are numbered from 0. An earlier edit in `out` stays
/// until the new one is complete. Throws InputError as check_output(), and for a clip that exceeds
/// the limits of motion.v3d; std::runtime_error for errors of the disk.
void write_clip(const TakeClip& edited, const std::filesystem::path& source,
                const std::string& edits, const std::filesystem::path& out);

}  // namespace v3d::ctl
