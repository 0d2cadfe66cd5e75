// Which pictures of several videos belong together: a table of time stamps, as caliscope and
// freemocap write it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace v3d::calib {

/// By camera id, by frame index: the instant (sync_index).
using TimeStamps = std::map<std::string, std::map<int64_t, int64_t>>;

/// A CSV with the columns sync_index, cam_id (or port) and frame_index; further columns, and lines
/// without a frame, are passed over. Throws InputError with `path` and line.
TimeStamps parse_time_stamps(std::string_view csv, const std::filesystem::path& path);

/// Frame of the video (from 0) to instant, for one camera. Camera ids are matched by name, else by
/// the number at the name's end ("cam_2" is 2, and so is "cam02"). Where the indices reach beyond
/// the video's `frames` (0: unknown), they are counted from the camera's first. Throws InputError
/// where the table does not have the camera.
std::map<int64_t, int64_t> instants_of(const TimeStamps& stamps, const std::string& camera,
                                       int64_t frames, const std::filesystem::path& path);

}  // namespace v3d::calib
