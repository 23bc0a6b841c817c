#include "stitch/interchange/panotools_masks.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/interchange/export_heads.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

/// Hugin's pixel centres are at integers.
constexpr double kCentre = 0.5;

/// Types of masks: the inside is excluded from the image, from the images of its stack, or from all with its lens.
constexpr double kExclude = 0, kExcludeFromStack = 2, kExcludeFromLens = 4;

Result<double> number_of(const ScriptLine& line, const char* name) {
  const std::string* value = line.find(name);
  if (value == nullptr) {
    return fail(Errc::kMissingField, fmt::format("line {}: the mask has no '{}'", line.number, name));
  }
  return to_number(line, name, *value);
}

/// Reads no more numbers than a head's masks may have.
Result<std::vector<Region::Point>> corners_of(const ScriptLine& line) {
  const std::string* value = line.find("p");
  std::vector<Region::Point> corners;
  std::optional<double> x;
  std::string_view rest = value == nullptr ? std::string_view() : std::string_view(*value);
  while (corners.size() <= kMaxMaskPoints) {
    const std::size_t begin = rest.find_first_not_of(" \t,");
    if (begin == std::string_view::npos) break;
    const std::size_t end = std::min(rest.find_first_of(" \t,", begin), rest.size());
    NODAL_TRY_ASSIGN(const double number, to_number(line, "p", rest.substr(begin, end - begin)));
    rest.remove_prefix(end);
    if (x) corners.push_back({*x + kCentre, number + kCentre});
    x = x ? std::nullopt : std::optional<double>(number);
  }
  if (x && corners.size() <= kMaxMaskPoints) {
    return fail(Errc::kBadValue, fmt::format("line {}: the mask has an x without a y", line.number));
  }
  return corners;
}

}  // namespace

Status add_masks(std::span<const ScriptLine* const> lines, std::span<const std::optional<std::size_t>> head_of,
                 ImportResult& result) {
  for (const ScriptLine* line : lines) {
    const std::string where = fmt::format("line {}", line->number);
    NODAL_TRY_ASSIGN(const double image, number_of(*line, "i"));
    auto& heads = result.calibration.heads;
    if (!(image >= 0 && image < static_cast<double>(head_of.size())) || image != std::floor(image)) {
      return fail(Errc::kBadValue, fmt::format("{}: the mask is of image {}, and there are {}", where,
                                               short_number(image), head_of.size()));
    }
    NODAL_TRY_ASSIGN(const double type, number_of(*line, "t"));
    const std::optional<std::size_t> own = head_of[static_cast<std::size_t>(image)];
    if (!own) continue;
    HeadCalibration& head = heads[*own];
    if (type != kExclude && type != kExcludeFromStack && type != kExcludeFromLens) {
      result.notes.push_back("Head '" + head.name + "', " + where +
                             ": a mask that keeps what is inside it is left out: Nodal's masks hide.");
      continue;
    }
    NODAL_TRY_ASSIGN(std::vector<Region::Point> corners, corners_of(*line));
    head.region.masks.push_back(std::move(corners));
    if (const Status checked = check_head(head); !checked) {
      head.region.masks.pop_back();
      result.notes.push_back("Head '" + head.name + "', " + where +
                             ": the mask is left out: " + checked.error().message + ".");
    } else if (type == kExcludeFromLens) {
      result.notes.push_back(
          "Head '" + head.name + "', " + where +
          ": a mask for all images with this lens hides only this head's pixels; copy it to others.");
    }
  }
  return {};
}

std::string mask_lines(const Region& region, std::size_t image) {
  std::string text;
  for (const std::vector<Region::Point>& mask : region.masks) {
    std::string corners;
    for (const Region::Point& corner : mask) {
      corners += (corners.empty() ? "" : " ") + exact(corner.x - kCentre) + " " + exact(corner.y - kCentre);
    }
    text += fmt::format("k i{} t0 p\"{}\"\n", image, corners);
  }
  return text;
}

}  // namespace nodal::interchange
