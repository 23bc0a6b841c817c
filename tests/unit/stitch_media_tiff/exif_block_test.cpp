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

TEST(AddExif, OfBothByteOrders_IsReadBackFromTheTiff) {
  for (const bool big : {false, true}) {
    Tiff exif(big);  // dates, place: text, numbers of 16 bits, pairs of 32, single bytes
    constexpr std::uint32_t kExif = 8 + 2 + 3 * 12 + 4, kGps = kExif + 2 + 2 * 12 + 4 + 20,
                            kMake = kGps + 2 + 2 * 12 + 4 + 24;
    exif.directory({{271, 2, 7, kMake}, {34665, 4, 1, kExif}, {34853, 4, 1, kGps}});
    exif.directory({{0x9003, 2, 20, kExif + 2 + 2 * 12 + 4}, {0xA001, 3, 1, big ? 0xFFFF0000U : 0xFFFFU}});
    exif.text(std::string("2024:05:06 07:08:09\0", 20));
    exif.directory({{1, 2, 2, big ? 0x4e000000U : 0x4eU}, {2, 5, 3, kGps + 2 + 2 * 12 + 4}});
    for (const std::uint32_t number : {52U, 1U, 30U, 1U, 123456U, 10000U}) exif.put(number, 4);
    exif.text(std::string("Camera\0", 7));
    Tiff plain(false);
    plain.directory({{256, 4, 1, 100}, {257, 3, 1, 50}});
    Bytes file = plain.bytes();
    add_exif(file, exif.bytes());
    ASSERT_TRUE(std::equal(plain.bytes().begin() + 8, plain.bytes().end(), file.begin() + 8)) << "nothing moves";
    const Bytes block = exif_block(file);
    EXPECT_TRUE(holds(block, "2024:05:06 07:08:09"));
    EXPECT_TRUE(holds(block, "Camera"));
    const std::string seconds{'\x40', '\xe2', '\x01', '\0', '\x10', '\x27', '\0', '\0'};  // 123456 / 10000
    EXPECT_TRUE(holds(block, seconds)) << big;
    // The entries that it had are in the new first directory, which is sorted.
    const auto number = [&](std::size_t at, int count) {
      std::uint32_t value = 0;
      for (int k = count - 1; k >= 0; --k) value = value << 8 | file[at + static_cast<std::size_t>(k)];
      return value;
    };
    const std::size_t first = number(4, 4);
    ASSERT_EQ(number(first, 2), 5U);
    const std::vector<std::uint32_t> tags{256, 257, 271, 34665, 34853};
    for (std::size_t k = 0; k < tags.size(); ++k) EXPECT_EQ(number(first + 2 + 12 * k, 2), tags[k]);
    EXPECT_EQ(number(first + 2 + 8, 4), 100U);
    EXPECT_EQ(number(first + 2 + 12 + 8, 2), 50U);
  }
  Bytes untouched{'I', 'I', 42, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  const Bytes before = untouched;
  add_exif(untouched, {});
  EXPECT_EQ(untouched, before);
}

TEST(ExifBlock, BrokenOffsetsAndLargeValues_AreLeftOut) {
  EXPECT_TRUE(exif_block({}).empty());
  EXPECT_TRUE(exif_block(Bytes{'I', 'I', 42, 0, 0xff, 0xff, 0xff, 0xff}).empty());
  Tiff tiff(false);
  tiff.directory({{271, 2, 0xffffffffU, 8},    // longer than anything
                  {272, 2, 2000, 8},           // over the limit
                  {306, 2, 20, 0xfffffff0U},   // beyond the end
                  {306, 99, 1, 0},             // no known type
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
