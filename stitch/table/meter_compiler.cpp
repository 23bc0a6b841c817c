#include "stitch/table/meter_compiler.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/response.h"

namespace nodal::table {
namespace {

constexpr int kRows = kMeterColumns / 2;

std::int16_t stops(double light) {
  return static_cast<std::int16_t>(std::lround(std::clamp(std::log2(light), -24.0, 24.0) * kStop));
}

blend::MeterTable::Head describe(const geometry::Head& head) {
  blend::MeterTable::Head made;
  made.width = static_cast<std::uint16_t>(head.width());
  made.height = static_cast<std::uint16_t>(head.height());
  for (std::size_t level = 0; level < made.stops.size(); ++level) {
    const double encoded = (level == 0 ? 0.5 : static_cast<double>(level)) / 255;
    made.stops[level] = stops(std::max(1e-7, geometry::decode(head.calibration().response, encoded)));
  }
  return made;
}

/// The upper left one of the four samples around a position, clamped so that all four are in the picture.
std::uint16_t corner(double at, int size) {
  return static_cast<std::uint16_t>(std::clamp(static_cast<int>(std::floor(at - 0.5)), 0, size - 2));
}

}  // namespace

Result<blend::MeterTable> compile_meter_table(const Calibration& calibration) {
  NODAL_TRY_ASSIGN(const std::vector<geometry::Head> heads, geometry::make_heads(calibration));
  blend::MeterTable table;
  for (const geometry::Head& head : heads) table.heads.push_back(describe(head));
  for (int row = 0; row < kRows; ++row) {
    // The solid angle of a cell, as a fraction of the sphere: (sin b - sin a) / 2 / columns.
    const double top = std::numbers::pi * (static_cast<double>(row) / kRows - 0.5);
    const double bottom = std::numbers::pi * (static_cast<double>(row + 1) / kRows - 0.5);
    const double part = (std::sin(bottom) - std::sin(top)) / 2 / kMeterColumns;
    const double phi = (top + bottom) / 2;
    for (int column = 0; column < kMeterColumns; ++column) {
      const double theta = 2 * std::numbers::pi * ((column + 0.5) / kMeterColumns - 0.5);
      const geometry::Ray ray =
          geometry::Ray::towards({std::sin(theta) * std::cos(phi), std::sin(phi), std::cos(theta) * std::cos(phi)});
      std::uint32_t seen = 0;
      for (std::size_t h = 0; h < heads.size(); ++h) {
        const geometry::Head& head = heads[h];
        const auto pixel = head.pixel_of(ray);
        if (!pixel) continue;
        const auto& gain = head.calibration().gain;
        const double left = head.vignetting(*pixel) * (0.299 * gain[0] + 0.587 * gain[1] + 0.114 * gain[2]);
        table.samples.push_back({corner(pixel->x, head.width()), corner(pixel->y, head.height()),
                                 stops(std::max(left, 1e-3)), static_cast<HeadIndex>(h)});
        seen |= std::uint32_t{1} << h;
      }
      table.cells.push_back({static_cast<std::uint32_t>(std::lround(part * (1 << 24))),
                             static_cast<std::uint32_t>(table.samples.size())});
      for (std::size_t h = 0; h < heads.size(); ++h) {
        if ((seen >> h & 1) != 0) table.heads[h].overlaps |= seen & ~(std::uint32_t{1} << h);
      }
    }
  }
  return table;
}

}  // namespace nodal::table
