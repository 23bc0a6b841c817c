// Copies a record from one table, or from one run of tiles, to another.
#pragma once

#include <cstdint>
#include <span>

#include "stitch/blend/blend_table.h"

namespace nodal::table {

/// Appends a record with its list of coordinates, which is taken from `lists`. The second of a pair has the first one's
/// list.
inline void append_record(blend::PatchRecord record, std::span<const std::uint16_t> lists, blend::GridTable& to) {
  constexpr std::size_t kList = 2 * blend::kTilePixels;
  if (record.listed() && record.has(0)) {
    const std::span<const std::uint16_t> list = lists.subspan(record.list() * kList, kList);
    record.set_list(to.coordinates.size() / kList);
    to.coordinates.insert(to.coordinates.end(), list.begin(), list.end());
  } else if (record.listed()) {
    record.set_list(to.records.back().list());
  }
  to.records.push_back(record);
}

}  // namespace nodal::table
