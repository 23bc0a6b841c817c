// References between the pictures of HEIF files, built by hand from ISO/IEC 14496-12 and 23008-12.
#include "stitch/media/heif_webp/heif_references.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string_view>
#include <vector>

namespace nodal::media {
namespace {

using Bytes = std::vector<std::uint8_t>;

void append(Bytes& bytes, std::uint64_t value, int width) {
  for (int k = width - 1; k >= 0; --k) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * k));
}

Bytes box(std::string_view type, const Bytes& content, bool long_size = false) {
  Bytes bytes;
  append(bytes, long_size ? 1 : 8 + content.size(), 4);
  bytes.insert(bytes.end(), type.begin(), type.end());
  if (long_size) append(bytes, 16 + content.size(), 8);
  bytes.insert(bytes.end(), content.begin(), content.end());
  return bytes;
}

struct Reference {
  std::string_view type;
  unsigned from;
  std::vector<unsigned> to;
};

Bytes file_of(const std::vector<Reference>& references, int id_width = 2, bool long_size = false) {
  Bytes iref{static_cast<std::uint8_t>(id_width == 2 ? 0 : 1), 0, 0, 0};
  for (const Reference& reference : references) {
    Bytes content;
    append(content, reference.from, id_width);
    append(content, reference.to.size(), 2);
    for (const unsigned to : reference.to) append(content, to, id_width);
    const Bytes one = box(reference.type, content);
    iref.insert(iref.end(), one.begin(), one.end());
  }
  Bytes meta{0, 0, 0, 0};
  for (const Bytes& inner : {box("pitm", {0, 0, 0, 0, 0, 1}), box("iref", iref, long_size)}) {
    meta.insert(meta.end(), inner.begin(), inner.end());
  }
  Bytes file = box("ftyp", {'h', 'e', 'i', 'c', 0, 0, 0, 0});
  const Bytes last = box("meta", meta, long_size);
  file.insert(file.end(), last.begin(), last.end());
  return file;
}

TEST(HeifReferences, GridWithTilesAlphaAndThumbnail_IsBounded) {
  for (const int width : {2, 4}) {
    EXPECT_TRUE(
        are_references_bounded(file_of({{"dimg", 1, {2, 3, 4, 5}}, {"auxl", 6, {1}}, {"thmb", 7, {1}}}, width)));
  }
  EXPECT_TRUE(are_references_bounded({}));
}

TEST(HeifReferences, APictureThatIsAPartOfItself_IsNot) {
  for (const int width : {2, 4}) {
    for (const bool long_size : {false, true}) {
      EXPECT_FALSE(are_references_bounded(file_of({{"dimg", 2, {2}}}, width, long_size)));
      EXPECT_FALSE(are_references_bounded(file_of({{"dimg", 1, {2}}, {"dimg", 2, {1}}}, width, long_size)));
    }
  }
  EXPECT_FALSE(are_references_bounded(file_of({{"auxl", 1, {2}}, {"auxl", 2, {1}}}))) << "each is the other's alpha";
  EXPECT_FALSE(are_references_bounded(file_of({{"dimg", 1, {2}}, {"auxl", 1, {2}}})))
      << "a tile whose alpha is the grid";
  EXPECT_TRUE(are_references_bounded(file_of({{"thmb", 1, {2}}, {"thmb", 2, {1}}}))) << "thumbnails are not decoded";
}

TEST(HeifReferences, PicturesThatMultiplyAtEachStep_AreNot) {
  const std::vector<unsigned> three_hundred(300, 2);
  std::vector<unsigned> next(300, 3);
  EXPECT_TRUE(are_references_bounded(file_of({{"dimg", 1, three_hundred}})));
  EXPECT_FALSE(are_references_bounded(file_of({{"dimg", 1, three_hundred}, {"dimg", 2, next}}))) << "90000 tiles";
  std::vector<Reference> chain;
  for (unsigned k = 1; k < 100; ++k) chain.push_back({"dimg", k, {k + 1}});
  EXPECT_FALSE(are_references_bounded(file_of(chain))) << "a thread for each";
}

TEST(HeifReferences, ABoxThatIsLongerThanItsParent_CountsAsFarAsItGoes) {
  Bytes bytes = file_of({{"dimg", 2, {2}}});
  const auto dimg = std::ranges::search(bytes, std::string_view("dimg")).begin();
  *(dimg - 3) = 32;  // the last of four bytes of its length
  EXPECT_FALSE(are_references_bounded(bytes)) << "libheif 1.15 accepts that";
}

TEST(HeifReferences, ABoxThatIsShorterThanItsReference_IsReadToTheReferencesEnd) {
  for (const int length : {8, 10, 12}) {
    Bytes bytes = file_of({{"dimg", 2, {2}}});
    *(std::ranges::search(bytes, std::string_view("dimg")).begin() - 1) = static_cast<std::uint8_t>(length);
    EXPECT_FALSE(are_references_bounded(bytes)) << "libheif 1.15 does so, too; box of " << length;
  }
  // The box between two references of a file is right for one reader only.
  Bytes two = file_of({{"thmb", 1, {3}}, {"dimg", 2, {2}}});
  *(std::ranges::search(two, std::string_view("thmb")).begin() - 1) = 28;
  EXPECT_FALSE(are_references_bounded(two));
}

TEST(HeifReferences, FilesThatEndAnywhere_AreReadToTheirEnd) {
  const Bytes whole = file_of({{"dimg", 2, {2}}, {"auxl", 3, {2}}}, 4, true);
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const bool complete = size + 18 >= whole.size();  // the second reference has 18 bytes
    EXPECT_TRUE(!complete || !are_references_bounded(cut)) << size;
  }
}

}  // namespace
}  // namespace nodal::media
