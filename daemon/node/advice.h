// Advice to the operator: one sentence per kind of event, appended to the event's text.
#pragma once

namespace v3d::node::advice {

/// Events of capture nodes.
inline constexpr char kCameraLost[] =
    "It is reopened automatically; check its power, its cable and its trigger line with v3dctl "
    "doctor";
inline constexpr char kFramesMissing[] =
    "If the take must be complete, stop it; v3dctl stop lists the missing pulses";
inline constexpr char kRejoined[] =
    "Its cameras lack the pulses of the restart: if the take must be complete, stop it";
inline constexpr char kReadsLogs[] =
    "Its cameras lack the pulses until then: if the take must be complete, stop it";
inline constexpr char kNotRejoined[] =
    "If the take must be complete, stop it; when the cause is removed, systemctl restart "
    "'v3d-captured@*' on this PC tries again";
inline constexpr char kFramesSuspect[] =
    "Check the camera's trigger cable, and that nothing else triggers it; v3dctl verify lists the "
    "frames";
inline constexpr char kSettingsIgnored[] =
    "The camera may change its pictures by itself: switch this off with its maker's program or "
    "v4l2-ctl";
inline constexpr char kFirmware[] =
    "Cameras of one model may differ in their pictures and delays: update their firmware with the "
    "maker's program";
inline constexpr char kDisk[] =
    "Stop the take, then make room (v3dctl takes lists the takes), or check the disk (journalctl "
    "-k)";
inline constexpr char kTakesFolder[] =
    "Mount the disk of the takes on this PC, or correct takes under [storage]";
inline constexpr char kQueue[] =
    "Close other programs on this PC; stop the take before frames are lost, or use a faster disk";
inline constexpr char kQuarantined[] =
    "No action is needed if the take was aborted before its first pulse; the folder may be deleted";
inline constexpr char kUnsigned[] =
    "The take is complete; sign it on this PC: v3dctl takes sign TAKE --node NODE";
inline constexpr char kRecoveredUnsigned[] =
    "The next start of v3d-captured tries again; or sign it on this PC: v3dctl takes sign TAKE "
    "--node NODE";
inline constexpr char kSigningKey[] =
    "v3dctl verify rejects the takes that it signs: enter the public key in the studio file of "
    "every "
    "PC (v3dctl key node prints it)";
inline constexpr char kNoChecksum[] =
    "The take is closed; check the disk (journalctl -k), and read the file before the take is used";
inline constexpr char kStaysOpen[] =
    "What is on the disk is kept; check the disk (journalctl -k), then v3dctl verify TAKE "
    "--recover counts it. A node at fault records again after v3dctl abort";
inline constexpr char kTakeEnded[] =
    "What was recorded is kept; before the next take make room (v3dctl takes lists the "
    "takes), or check the disk (journalctl -k)";
inline constexpr char kTakeIsLong[] = "What was recorded is kept; arm the next take";
inline constexpr char kTrigger[] =
    "Stop the take; check the trigger's cable and power, then arm again";
inline constexpr char kActionCommands[] =
    "The take continues; check that the cameras are in one network with the trigger's PC and "
    "follow PTP, and compare the ledger's missing pulses of these cameras";
inline constexpr char kSenseLine[] =
    "The take continues, but its pulses are not verified; check the sense line's cable before the "
    "next take";
inline constexpr char kPulses[] =
    "Check for a loose trigger cable or a second generator on the line";
inline constexpr char kPulseLog[] =
    "The frames have their own pulse numbers; v3dctl verify lists the pulses missing from the log";
inline constexpr char kLivePicture[] =
    "All frames are recorded; for the live picture close other programs on this PC";
inline constexpr char kSound[] =
    "Pictures are recorded; check the device's cable, and device under [[sound]] (arecord -L lists "
    "the devices)";
inline constexpr char kSoundFile[] =
    "Pictures are recorded, but no more sound; check the disk (journalctl -k) before the next take";
inline constexpr char kSoundDisk[] =
    "It is lost if the daemon is killed, and gaps follow at 10 s; check the disk (journalctl -k)";
inline constexpr char kSoundXruns[] =
    "The file has silence there, and ledger.toml lists the places; close other programs on this PC";
inline constexpr char kTimecodeOutput[] =
    "Pictures are recorded; check the device's cable, and device under [timecode_output] (aplay -L "
    "lists the devices)";
inline constexpr char kLights[] =
    "Pictures are recorded with the previous light; start olad on this PC (systemctl start olad), "
    "or remove [lights]";
inline constexpr char kTimecodeUnderruns[] =
    "Devices that follow the timecode may have lost it; close other programs on this PC";
inline constexpr char kTimecodeJumps[] =
    "The take continues; ledger.toml lists the runs of timecode. Check the generator of the "
    "timecode and its cable";
inline constexpr char kSoundClips[] = "Reduce the gain of this channel";
inline constexpr char kSoundSilent[] =
    "Check its microphone, cable, power and gain; no action is needed where nothing is connected";

/// Events of reconstruction nodes.
inline constexpr char kMeshDisk[] =
    "The frames are safe on the capture PCs: make room, then v3dctl reconstruct TAKE";
inline constexpr char kBehind[] =
    "The recording is not affected: v3dctl reconstruct TAKE makes every mesh later; a larger voxel "
    "is faster";
inline constexpr char kFrameGroup[] =
    "It is tried again until it succeeds. The frames are safe on the capture PCs: v3dctl "
    "reconstruct "
    "TAKE makes the missing meshes";
inline constexpr char kMeshesMissing[] =
    "The frames are safe on the capture PCs: v3dctl reconstruct TAKE makes every mesh later";
inline constexpr char kCameraDisplaced[] =
    "Check its mount, calibrate it again, and omit it from this take: v3dctl reconstruct TAKE "
    "--leave-out CAMERA";
inline constexpr char kSilhouette[] =
    "Check its lens, light and background, and learn the background again; v3dctl reconstruct TAKE "
    "--repair repairs every pulse";
inline constexpr char kNoMesh[] = "v3dctl reconstruct TAKE tries again with other bounds or voxels";

}  // namespace v3d::node::advice
