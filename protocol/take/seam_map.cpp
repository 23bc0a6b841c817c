#include "protocol/take/seam_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "protocol/base/try.h"

namespace nodal::take {
namespace {

/// A run is a byte: the head in its low bits, the length less 1 above; kLong there: the length less 8 follows, 7 bits a
/// byte, the lowest first, with the top bit set in all but the last.
constexpr std::uint32_t kHeadBits = 5, kNobody = 31, kLong = 7, kShortest = kLong + 1;

std::uint32_t pixels_of(std::uint32_t columns) { return columns * (columns / 2); }

/// Calls visit(label, length) for each run. False if the runs do not have this many pixels together, are cut off, or
/// name another head than the first `heads`.
template <class Visit>
bool for_runs(std::string_view runs, std::uint32_t pixels, std::size_t heads, const Visit& visit) {
  std::uint32_t sum = 0;
  for (std::size_t k = 0; k < runs.size();) {
    const auto byte = static_cast<std::uint8_t>(runs[k++]);
    const std::uint32_t head = byte & ((1U << kHeadBits) - 1);
    std::uint32_t length = (byte >> kHeadBits) + 1U;
    if (length == kShortest) {
      std::uint32_t more = 0, shift = 0;
      for (bool last = false; !last; shift += 7) {
        if (k == runs.size() || shift > 14) return false;
        const auto part = static_cast<std::uint8_t>(runs[k++]);
        more |= static_cast<std::uint32_t>(part & 0x7f) << shift;
        last = (part & 0x80) == 0;
      }
      length += more;
    }
    if ((head >= heads && head != kNobody) || length > pixels - sum) return false;
    sum += length;
    visit(head == kNobody ? kNoHeadOfSeams : static_cast<std::uint8_t>(head), length);
  }
  return sum == pixels;
}

Error not_a_map(const wire::Seams& seams, std::size_t heads) {
  return {Errc::kBadFormat,
          fmt::format("the seams from set {} on are not a map of {}x{} pixels, each with one of {} heads", seams.set(),
                      seams.columns(), seams.columns() / 2, heads)};
}

}  // namespace

wire::Seams seams_record(std::uint64_t set, std::uint32_t columns, std::span<const std::uint8_t> labels) {
  wire::Seams seams;
  seams.set_set(set);
  if (labels.empty()) return seams;
  NODAL_ASSERT(columns <= kMaxSeamColumns && labels.size() == pixels_of(columns));
  seams.set_columns(columns);
  std::string& runs = *seams.mutable_runs();
  for (std::size_t from = 0, to = 0; from < labels.size(); from = to) {
    while (to < labels.size() && labels[to] == labels[from]) ++to;
    const auto length = static_cast<std::uint32_t>(to - from);
    const std::uint32_t head = labels[from] == kNoHeadOfSeams ? kNobody : labels[from];
    runs.push_back(static_cast<char>(head | std::min(length - 1, kLong) << kHeadBits));
    if (length < kShortest) continue;
    std::uint32_t more = length - kShortest;
    for (; more >= 0x80; more >>= 7) runs.push_back(static_cast<char>((more & 0x7f) | 0x80));
    runs.push_back(static_cast<char>(more));
  }
  return seams;
}

Status check_seams(const wire::Seams& seams, std::size_t heads) {
  const std::uint32_t columns = seams.columns();
  if (columns == 0 && seams.runs().empty()) return {};
  const bool whole = columns != 0 && columns <= kMaxSeamColumns && columns % 2 == 0 &&
                     for_runs(seams.runs(), pixels_of(columns), heads, [](std::uint8_t, std::uint32_t) {});
  return whole ? Status() : fail(not_a_map(seams, heads));
}

Result<std::vector<std::uint8_t>> labels_of(const wire::Seams& seams) {
  NODAL_TRY(check_seams(seams));
  std::vector<std::uint8_t> labels;
  labels.reserve(pixels_of(seams.columns()));
  for_runs(seams.runs(), pixels_of(seams.columns()), kMaxHeads,
           [&](std::uint8_t label, std::uint32_t length) { labels.insert(labels.end(), length, label); });
  return labels;
}

}  // namespace nodal::take
