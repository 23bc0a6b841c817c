#include "host_tool/rig/bulk_item.h"

#include <fmt/format.h>

#include <algorithm>

#include "host_tool/console/quantities.h"

namespace nodal::host {

Status BulkItemBytes::begin(const BulkPiece& first, std::uint64_t limit, std::string_view what) {
  bytes_.clear();
  total_ = first.total;
  if (total_ <= limit) return {};
  return fail(Errc::kTooLarge, fmt::format("the rig announced {} of {}, but its header allows at most {}", what,
                                           show_bytes(total_), show_bytes(limit)));
}

void BulkItemBytes::add(const BulkPiece& piece) {
  const std::size_t needed = bytes_.size() + piece.data.size();
  NODAL_ASSERT(needed <= total_);  // the session checks every piece against its item's length
  if (needed > bytes_.capacity())
    bytes_.reserve(std::min<std::size_t>(std::max(needed, 2 * bytes_.capacity()), total_));
  bytes_.insert(bytes_.end(), piece.data.begin(), piece.data.end());
}

}  // namespace nodal::host
