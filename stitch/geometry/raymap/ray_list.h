// Lists of rays from files, which a layout "rays:HASH" names. Free of Eigen, as the registry.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/raymap/registry.h"

namespace nodal::geometry {

inline constexpr std::size_t kMaxRays = 1 << 21;
inline constexpr std::size_t kMaxRayLists = 16;

/// Rays row by row, of length 1; the rig's axes.
struct RayList {
  RaymapSize size;
  std::vector<std::array<double, 3>> rays;
};

/// Text: a line "rays WIDTH HEIGHT", both even, then a line "X Y Z" for every ray, of any length, row by row. Empty
/// lines and what follows a # are skipped.
/// Errors, with the line: kTooLarge beyond kMaxRayFileBytes, kMaxRays or kMaxRaymapSide; kBadFormat for another line;
/// kBadValue for numbers that are no direction, and for two rays that are the same to 1e-12; kTruncated for too few.
Result<RayList> parse_ray_list(std::string_view text);

/// Makes a file's list known to this process: LayoutName::parse() then takes the name that is returned, "rays:" and the
/// first 16 hexadecimal digits of the SHA-256 of the text. It stays known. Errors: those of parse_ray_list(), kTooLarge
/// for more than kMaxRayLists.
///
/// Threading: any thread.
Result<std::string> make_ray_list_known(std::string_view text);

/// The list with these digits as a number, or null. It stays until the process ends.
const RayList* known_ray_list(std::uint64_t digits);

}  // namespace nodal::geometry
