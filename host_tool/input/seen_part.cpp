#include "host_tool/input/seen_part.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/geometry/turned_rig.h"

namespace nodal::host {
namespace {

constexpr int kSightColumns = 720;  ///< columns of the grid on which heads are looked for

/// The longest run of columns around the circle that are false.
RaymapPart longest_gap(const std::vector<bool>& seen) {
  const int count = static_cast<int>(seen.size());
  RaymapPart longest;
  for (int from = 0; from < count; ++from) {
    if (seen[static_cast<std::size_t>(from)] || !seen[static_cast<std::size_t>((from + count - 1) % count)]) continue;
    int length = 0;
    while (length < count && !seen[static_cast<std::size_t>((from + length) % count)]) ++length;
    if (length > longest.width) longest = {from, 0, length, 0};
  }
  return longest;
}

class Sight {
 public:
  Sight(const std::vector<geometry::Head>& heads, geometry::RaymapSize size) : heads_(heads), size_(size) {}

  /// Whether a head sees the point, in pixels of the raymap.
  bool sees(double x, double y) const {
    const geometry::Ray ray = geometry::Ray::at({(x / size_.width - 0.5) * 2 * kPi, (y / size_.height - 0.5) * kPi});
    return std::ranges::any_of(heads_, [&](const geometry::Head& head) { return head.pixel_of(ray).has_value(); });
  }
  bool sees_in_row(int y, int left, int width) const {
    for (int x = left; x < left + width; ++x)
      if (sees(x % size_.width + 0.5, y + 0.5)) return true;
    return false;
  }
  bool sees_in_column(int x, int top, int height) const {
    for (int y = top; y < top + height; ++y)
      if (sees((x % size_.width) + 0.5, y + 0.5)) return true;
    return false;
  }

 private:
  const std::vector<geometry::Head>& heads_;
  geometry::RaymapSize size_;
};

/// Takes away what no head sees at the edges of a part that holds all that is seen.
void tighten(const Sight& sight, geometry::RaymapSize size, RaymapPart& part) {
  while (part.height > 1 && !sight.sees_in_row(part.top, part.left, part.width)) ++part.top, --part.height;
  while (part.height > 1 && !sight.sees_in_row(part.top + part.height - 1, part.left, part.width)) --part.height;
  if (part.width == size.width) return;
  while (part.width > 1 && !sight.sees_in_column(part.left, part.top, part.height)) ++part.left, --part.width;
  while (part.width > 1 && !sight.sees_in_column(part.left + part.width - 1, part.top, part.height)) --part.width;
  part.left %= size.width;
}

}  // namespace

Result<SeenPart> seen_part(const Calibration& calibration, geometry::RaymapSize size) {
  NODAL_TRY_ASSIGN(const std::vector<geometry::Head> heads, geometry::make_heads(calibration));
  const Sight sight(heads, size);
  const int columns = std::min(kSightColumns, size.width), rows = std::max(1, std::min(kSightColumns / 2, size.height));
  const double step_x = static_cast<double>(size.width) / columns, step_y = static_cast<double>(size.height) / rows;
  std::vector<bool> in_column(static_cast<std::size_t>(columns));
  int first = rows, last = -1;
  double seen = 0, all = 0;
  for (int j = 0; j < rows; ++j) {
    const double weight = std::cos(((j + 0.5) / rows - 0.5) * kPi);
    for (int i = 0; i < columns; ++i) {
      all += weight;
      if (!sight.sees((i + 0.5) * step_x, (j + 0.5) * step_y)) continue;
      seen += weight;
      in_column[static_cast<std::size_t>(i)] = true;
      first = std::min(first, j);
      last = std::max(last, j);
    }
  }
  SeenPart found{seen / all, {0, 0, size.width, size.height}};
  if (last < 0) return found;
  // One cell more on each side than its points are seen in.
  const auto floor_of = [](double value) { return static_cast<int>(std::floor(value)); };
  const int top = std::max(0, floor_of((first - 1) * step_y));
  const int bottom = std::min(size.height, floor_of((last + 2) * step_y) + 1);
  found.part = {0, top, size.width, bottom - top};
  const RaymapPart gap = longest_gap(in_column);
  if (gap.width > 2) {
    const int left = floor_of((gap.left + gap.width - 1) * step_x);
    const int width = std::min(size.width, floor_of((columns - gap.width + 2) * step_x) + 1);
    found.part.left = left % size.width;
    found.part.width = width;
  }
  tighten(sight, size, found.part);
  return found;
}

Status turn_to_middle(Calibration& calibration) {
  const geometry::RaymapSize size{kSightColumns, kSightColumns / 2};
  NODAL_TRY_ASSIGN(const SeenPart seen, seen_part(calibration, size));
  if (seen.share >= kMinSphereShare || seen.part.width == size.width) return {};
  const double yaw = ((seen.part.left + seen.part.width / 2.0) / size.width - 0.5) * 360;
  calibration = geometry::turned_rig(std::move(calibration), geometry::to_R_head_rig({yaw, 0, 0}));
  return {};
}

}  // namespace nodal::host
