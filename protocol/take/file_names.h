// The names of a take's files (protocol/TAKE.md).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <ranges>
#include <string>
#include <string_view>
#include <vector>

namespace nodal::take {

/// File names in the folder of a take.
inline const std::string kTakeFile = "take.json", kManifestFile = "manifest", kProtectedFile = "protected",
                         kCalibrationFile = "calibration.json", kRigFile = "rig.toml", kThumbFile = "thumb.jpg",
                         kFlightFile = "flight", kDeletedFile = "deleted", kRecoveringFile = "recovering",
                         kSetAsideFile = "set-aside";

/// "000042".
std::string take_folder(std::uint64_t take);
/// "calibration-0001.json": the first after calibration.json.
std::string calibration_file(std::size_t number);
/// "cam0-0003.mkv", "raymap-0003.mkv", "evidence-0003".
std::string head_file(std::uint32_t head, std::uint32_t segment);
std::string raymap_file(std::uint32_t segment);
std::string evidence_file(std::uint32_t segment);

/// What the name of a segment's file says.
struct SegmentFile {
  enum class Kind : std::uint8_t { kHead, kRaymaps, kEvidence };
  Kind kind = Kind::kEvidence;
  std::uint32_t segment = 0;
  std::uint32_t head = 0;  ///< kHead: its number
};
/// Empty for any other name.
std::optional<SegmentFile> segment_file(std::string_view name);
/// Numbers of the segments whose evidence is among the names, rising.
template <std::ranges::input_range Names>
std::vector<std::uint32_t> segments_among(Names&& names) {
  std::vector<std::uint32_t> segments;
  for (const std::string& name : names) {
    const auto file = segment_file(name);
    if (file && file->kind == SegmentFile::Kind::kEvidence) segments.push_back(file->segment);
  }
  std::ranges::sort(segments);
  return segments;
}

/// Whether a take may have a file of this name.
bool is_take_file(std::string_view name);

}  // namespace nodal::take
