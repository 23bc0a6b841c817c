#include "stitch/media/tiff/exif_block.h"

#include <gtest/gtest.h>

#include <string>

namespace nodal::media {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct Tag {
  std::uint16_t tag, type;
  std::uint32_t count, value;  ///< or offset
};

/// A TIFF by the specification's bytes: the first directory at 8, others where they are put.
class Tiff {
 public:
  explicit Tiff(bool big) : big_(big), bytes_(big ? Bytes{'M', 'M', 0, 42} : Bytes{'I', 'I', 42, 0}) { put(8, 4); }
  void put(std::uint32_t value, int count) {
    for (int k = 0; k < count; ++k)
      bytes_.push_back(static_cast<std::uint8_t>(value >> 8 * (big_ ? count - 1 - k : k)));
  }
  void directory(const std::vector<Tag>& tags) {
    put(static_cast<std::uint32_t>(tags.size()), 2);
    for (const Tag& tag : tags) put(tag.tag, 2), put(tag.type, 2), put(tag.count, 4), put(tag.value, 4);
    put(0, 4);
  }
  void text(const std::string& words) { bytes_.insert(bytes_.end(), words.begin(), words.end()); }
  std::uint32_t end() const { return static_cast<std::uint32_t>(bytes_.size()); }
  const Bytes& bytes() const { return bytes_; }

 private:
  bool big_;
  Bytes bytes_;
};

bool holds(const Bytes& block, const std::string& words) {
  return std::string(block.begin(), block.end()).find(words) != std::string::npos;
}

TEST(ExifBlock, DirectoriesAnywhereInTheFile_AreTogether) {
  for (const bool big : {false, true}) {
    // Two entries of the first directory end at 8 + 2 + 24 + 4; then 70 000 bytes of pixels, then the Exif directory.
    Tiff tiff(big);
    constexpr std::uint32_t kExif = 38 + 70'000;
    tiff.directory({{256, 4, 1, 100}, {34665, 4, 1, kExif}});
    tiff.text(std::string(70'000, 'p'));
    tiff.directory({{0x9003, 2, 20, kExif + 18}});
    tiff.text(std::string("2024:05:06 07:08:09\0", 20));
    const Bytes block = exif_block(tiff.bytes());
    EXPECT_TRUE(holds(block, "2024:05:06 07:08:09"));
    EXPECT_LT(block.size(), 100U);
    EXPECT_EQ(block[0], big ? 'M' : 'I');
    EXPECT_EQ(exif_block(block), block) << "a block is a TIFF";
  }
}

TEST(ExifBlock, BrokenOffsetsAndLargeValues_AreLeftOut) {
  EXPECT_TRUE(exif_block({}).empty());
  EXPECT_TRUE(exif_block(Bytes{'I', 'I', 42, 0, 0xff, 0xff, 0xff, 0xff}).empty());
  Tiff tiff(false);
  tiff.directory({{271, 2, 0xffffffffU, 8},    // longer than anything
                  {272, 2, 2000, 8},           // over the limit
                  {306, 2, 20, 0xfffffff0U},   // beyond the end
                  {306, 99, 1, 0},             // of no type
                  {34665, 4, 1, 0xfffffffeU},  // beyond the end
                  {34853, 4, 1, 8}});          // this directory itself
  const Bytes block = exif_block(tiff.bytes());
  EXPECT_LT(block.size(), 200U);
  // A directory that claims 65535 entries.
  Tiff many(false);
  many.put(65535, 2);
  for (int k = 0; k < 1000; ++k) many.put(306, 2), many.put(2, 2), many.put(4, 4), many.put(0x61616161, 4);
  EXPECT_LE(exif_block(many.bytes()).size(), 8 + 2 + 12 * kMaxExifEntries + 4);
  // Every bit of a good one, changed.
  Tiff good(true);
  good.directory({{34853, 4, 1, 26}});
  good.directory({{1, 2, 2, 0x4e000000}, {2, 5, 3, 56}});
  for (std::uint32_t k = 0; k < 6; ++k) good.put(k + 1, 4);
  for (std::size_t k = 0; k < 8 * good.bytes().size(); ++k) {
    Bytes changed = good.bytes();
    changed[k / 8] ^= static_cast<std::uint8_t>(1U << k % 8);
    exif_block(changed);
  }
}

}  // namespace
}  // namespace nodal::media
