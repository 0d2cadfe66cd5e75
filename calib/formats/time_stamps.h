// Time stamps that assign frames of several videos to instants: the CSV of caliscope and freemocap.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace v3d::calib {

/// The instant (sync_index) by camera id and frame index.
using TimeStamps = std::map<std::string, std::map<int64_t, int64_t>>;

/// Reads a CSV with the columns sync_index, cam_id (or port) and frame_index. Further columns, and
/// rows without a frame, are ignored. Throws InputError with `path` and line.
TimeStamps parse_time_stamps(std::string_view csv, const std::filesystem::path& path);

/// The instants of one camera by frame of its video, counted from 0.
///
/// Camera ids match by name, else by the number at the end of the name ("cam_2" and "cam02" match
/// 2). Where frame indices exceed the number of `frames` in the video (0: unknown), they are
/// counted from the camera's first index. Throws InputError where the table lacks the camera.
std::map<int64_t, int64_t> frame_instants(const TimeStamps& stamps, const std::string& camera,
                                          int64_t frames, const std::filesystem::path& path);

}  // namespace v3d::calib
