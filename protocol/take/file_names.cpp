#include "protocol/take/file_names.h"

#include <fmt/format.h>

namespace nodal::take {
namespace {

/// Reads a name from its beginning.
class NameReader {
 public:
  explicit NameReader(std::string_view name) : left_(name) {}
  bool word(std::string_view expected) {
    if (!left_.starts_with(expected)) return false;
    left_.remove_prefix(expected.size());
    return true;
  }
  /// A number of `min` to 8 digits.
  std::optional<std::uint32_t> number(std::size_t min) {
    std::size_t digits = 0;
    std::uint32_t value = 0;
    for (; digits < left_.size() && digits <= 8 && left_[digits] >= '0' && left_[digits] <= '9'; ++digits)
      value = 10 * value + static_cast<std::uint32_t>(left_[digits] - '0');
    left_.remove_prefix(digits);
    return digits >= min && digits <= 8 ? std::optional(value) : std::nullopt;
  }
  bool ends_with(std::string_view ending) const { return left_ == ending; }

 private:
  std::string_view left_;
};

}  // namespace

std::string take_folder(std::uint64_t take) { return fmt::format("{:06}", take); }
std::string calibration_file(std::size_t number) { return fmt::format("calibration-{:04}.json", number); }
std::string head_file(std::uint32_t head, std::uint32_t segment) {
  return fmt::format("cam{}-{:04}.mkv", head, segment);
}
std::string raymap_file(std::uint32_t segment) { return fmt::format("raymap-{:04}.mkv", segment); }
std::string evidence_file(std::uint32_t segment) { return fmt::format("evidence-{:04}", segment); }

std::optional<SegmentFile> segment_file(std::string_view name) {
  using Kind = SegmentFile::Kind;
  NameReader reader(name);
  SegmentFile file;
  if (reader.word("cam")) {
    file.kind = Kind::kHead;
    const auto head = reader.number(1);
    if (!head || !reader.word("-")) return std::nullopt;
    file.head = *head;
  } else if (reader.word("raymap-")) {
    file.kind = Kind::kRaymaps;
  } else if (!reader.word("evidence-")) {
    return std::nullopt;
  }
  const auto segment = reader.number(4);
  if (!segment || !reader.ends_with(file.kind == Kind::kEvidence ? "" : ".mkv")) return std::nullopt;
  file.segment = *segment;
  return file;
}

bool is_take_file(std::string_view name) {
  for (const std::string& each : {kTakeFile, kManifestFile, kProtectedFile, kCalibrationFile, kRigFile, kThumbFile,
                                  kFlightFile, kDeletedFile, kRecoveringFile, kSetAsideFile}) {
    if (name == each) return true;
  }
  if (segment_file(name)) return true;
  NameReader reader(name);
  return reader.word("calibration-") && reader.number(4) && reader.ends_with(".json");
}

}  // namespace nodal::take
