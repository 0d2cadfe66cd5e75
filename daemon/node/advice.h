// What an operator can do about what events tell: one sentence each, said after the event's text.
#pragma once

namespace v3d::advice {

/// Events of capture nodes.
inline constexpr char kCameraLost[] =
    "It is opened again by itself and goes on; check its power, its cable and its trigger line "
    "with "
    "v3dctl doctor";
inline constexpr char kFramesMissing[] =
    "Stop the take when it must be whole; v3dctl stop names the missing pulses";
inline constexpr char kRejoined[] =
    "The pulses between are missing from its cameras: stop the take when it must be whole";
inline constexpr char kFramesSuspect[] =
    "Check the camera's trigger cable and that nothing else triggers it; v3dctl verify names the "
    "frames";
inline constexpr char kDisk[] = "Stop the take, then make room: v3dctl takes lists what lies there";
inline constexpr char kQueue[] =
    "Close other programs on this PC; stop the take before frames are lost, or take a faster disk";
inline constexpr char kQuarantined[] =
    "Nothing to do when the take was aborted before its first pulse; the folder may be deleted";
inline constexpr char kUnsigned[] =
    "The take is whole; sign it on this PC: v3dctl takes sign TAKE --node NODE";
inline constexpr char kTakeEnded[] =
    "What was recorded is kept; before the next take make room (v3dctl takes lists what lies "
    "there), or look after the disk (journalctl -k)";
inline constexpr char kTrigger[] =
    "Stop the take; check the trigger's cable and power, then arm again";
inline constexpr char kSenseLine[] =
    "The take goes on without being sensed; check the sense line's cable before the next";
inline constexpr char kPulses[] =
    "Look for a loose trigger cable or a second generator on the line";
inline constexpr char kPulsesRefused[] =
    "The frames carry their pulse numbers themselves; v3dctl verify names the pulses that "
    "the log lacks";
inline constexpr char kLivePicture[] =
    "Nothing to do for this take, all is recorded; close other programs on this PC";

/// Events of the reconstruction node.
inline constexpr char kMeshDisk[] =
    "The frames are safe on the capture PCs: make room, then v3dctl reconstruct TAKE";
inline constexpr char kBehind[] =
    "The take is not touched: v3dctl reconstruct TAKE makes every mesh later; a larger voxel keeps "
    "up";
inline constexpr char kMeshesMissing[] =
    "The frames are safe on the capture PCs: v3dctl reconstruct TAKE makes every mesh later";
inline constexpr char kKnocked[] =
    "Look after its mount, calibrate it again, and leave it out of this take: v3dctl reconstruct "
    "TAKE "
    "--leave-out CAMERA";
inline constexpr char kNoMesh[] = "v3dctl reconstruct TAKE tries again with other bounds or voxels";

}  // namespace v3d::advice
