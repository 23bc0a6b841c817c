#include "rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "heap.h"
#include "tests/support/limits_page.h"

namespace nodal::limits {

namespace {

const char* name_of(Means means) {
  switch (means) {
    case Means::kHeap: return "heap";
    case Means::kSizes: return "sizes";
    case Means::kAddresses: return "addresses";
  }
  return "";
}

}  // namespace

void check(const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    SCOPED_TRACE(row.what);
    const auto figure = test::figure_on_page(NODAL_SOURCE_DIR, row.what);
    if (!figure) {
      ADD_FAILURE() << "no row of protocol/LIMITS.md has this name and a figure";
      continue;
    }
    EXPECT_EQ(figure->means, name_of(row.means));
    if (row.means == Means::kHeap && !kCountsHeap) continue;
    const std::uint64_t needs = row.needs();
    std::printf("%-72.72s %12llu bytes, on the page %12llu\n", row.what.c_str(), static_cast<unsigned long long>(needs),
                static_cast<unsigned long long>(figure->bytes));
    if (figure->counts || row.means == Means::kAddresses) {
      EXPECT_EQ(needs, figure->bytes);
      continue;
    }
    EXPECT_LE(needs, figure->bytes) << "the row needs more than the page says";
    EXPECT_LE(figure->bytes, std::max<std::uint64_t>(2 * needs, 1024)) << "the page says much more than it needs";
  }
}

}  // namespace nodal::limits
