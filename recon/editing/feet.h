// Footskate cleanup: detects foot contacts and holds the ankles in place during them.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "recon/editing/clip.h"

namespace v3d::recon {

/// A range of frames in which a foot is in contact with the floor.
struct FootContact {
  Joint ankle = kLeftAnkle;
  ClipRange range;
};

/// Times of at least four frames in which an ankle is within 4 cm of its usual lowest height and
/// moves by at most 0.35 m/s along the floor.
std::vector<FootContact> foot_contacts(const Clip& clip);

/// Largest distance of an ankle along the floor from its mean position in a contact, metres.
double foot_slide(const Clip& clip, const std::vector<FootContact>& contacts);

/// Moves the ankle along the floor to its mean position in each contact, by turning thigh and shin.
/// The ankle keeps its height and the foot its direction. Where an ankle is out of reach, the body
/// first moves by the least shift with which both legs reach their ankles. Corrections and shifts
/// fade within `fade` frames.
///
/// Source: Kovar, Schreiner and Gleicher, Footskate cleanup for motion capture editing, SCA 2002;
/// here bones keep their lengths, and where no shift is enough for both legs, the ankles are
/// approached as far as possible.
void hold_feet(Clip& clip, const std::vector<FootContact>& contacts, size_t fade);

/// Holds the feet in all contacts until none slides by more than 1 mm, at most 20 times: a held
/// foot can stand for longer than before, so contacts are found again. Calls `on_pass` before each
/// time; it may throw.
void hold_all_feet(Clip& clip, size_t fade, const std::function<void()>& on_pass);

}  // namespace v3d::recon
