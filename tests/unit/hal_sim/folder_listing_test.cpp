// A folder of as many entries as a disk lists: within the memory of LIMITS.md, and one more is refused.
#include "hal/folder_listing.h"

#include <gtest/gtest.h>

#include "tests/support/within_memory.h"

namespace nodal::hal {
namespace {

const std::uint64_t kFolderMiB = test::memory_on_page(NODAL_SOURCE_DIR, "files and folders in a folder of a disk");

std::string name_of(std::size_t k, std::size_t length) {
  const std::string number = std::to_string(k);
  return std::string(length - number.size(), 'x') + number;
}

TEST(FolderListing, OfAsManyEntriesAsThereMayBe_IsWithinItsBudgetAndOneMoreIsRefused) {
  EXPECT_TRUE(test::within_memory(kFolderMiB, [] {
    constexpr std::size_t kLength = FolderListing::kMaxNamesBytes / FolderListing::kMaxEntries;
    FolderListing listing("takes");
    for (std::size_t k = 0; k < FolderListing::kMaxEntries; ++k) {
      if (!listing.add({name_of(k, kLength), EntryKind::kFile, k})) return false;
    }
    const Status more = listing.add({"", EntryKind::kFile, 0});
    if (more || more.error().message.find("takes") == std::string::npos) return false;
    return FolderListing::names_of(std::move(listing).entries()).size() == FolderListing::kMaxEntries;
  }));
}

TEST(FolderListing, OfTheLongestNames_IsRefusedWithinItsBudget) {
  EXPECT_TRUE(test::within_memory(kFolderMiB, [] {
    FolderListing listing("takes");
    Status added;
    std::size_t count = 0;
    for (; added; ++count) added = listing.add({name_of(count, 255), EntryKind::kFile, count});
    return added.error().code == Errc::kTooLarge && (count - 1) * 255 <= FolderListing::kMaxNamesBytes &&
           count * 255 > FolderListing::kMaxNamesBytes;
  }));
}

}  // namespace
}  // namespace nodal::hal
