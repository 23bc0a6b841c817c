// Sums that are bit-identical for any number of threads.
#pragma once

#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

namespace nodal::solve {

/// Calls work(0) .. work(count - 1), in any order, possibly concurrently. Callers with threads pass one that uses them.
using ForEach = std::function<void(int count, const std::function<void(int)>& work)>;

/// The ForEach for callers without threads.
inline void one_by_one(int count, const std::function<void(int)>& work) {
  for (int i = 0; i < count; ++i) work(i);
}

/// The sum of `pieces` parts, each filled by fill(piece, part) from a copy of `zero`. Parts are added in index order,
/// so the sum does not depend on the number of threads as long as `pieces` does not.
template <class Sum, class EachPiece, class Fill>
Sum sum_of_pieces(int pieces, const Sum& zero, EachPiece&& for_each, Fill&& fill) {
  std::vector<Sum> parts(static_cast<std::size_t>(pieces), zero);
  for_each(pieces, [&](int piece) { fill(piece, parts[static_cast<std::size_t>(piece)]); });
  for (std::size_t i = 1; i < parts.size(); ++i) parts[0].add(parts[i]);
  return std::move(parts[0]);
}

}  // namespace nodal::solve
