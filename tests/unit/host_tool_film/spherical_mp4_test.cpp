// The index of MP4 files, built by hand from ISO/IEC 14496-12: where the metadata goes, how chunk offsets move, and
// boxes that lie.
#include "host_tool/film/spherical_mp4.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/pictures.h"

namespace nodal::film {
namespace {

using Content = std::vector<std::uint8_t>;

Content joined(std::initializer_list<Content> parts) {
  Content all;
  for (const Content& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}
Content integer(std::uint64_t value, int bytes) {
  Content made;
  for (int shift = 8 * bytes - 8; shift >= 0; shift -= 8) made.push_back(static_cast<std::uint8_t>(value >> shift));
  return made;
}
Content text(const std::string& words) { return {words.begin(), words.end()}; }
Content box(const std::string& type, const Content& content) {
  return joined({integer(content.size() + 8, 4), text(type), content});
}
Content track(const std::string& handler, const Content& entry, const Content& offsets) {
  const Content hdlr = box("hdlr", joined({integer(0, 8), text(handler), integer(0, 12)}));
  const Content stsd = box("stsd", joined({integer(1, 8), entry}));
  return box("trak", box("mdia", joined({hdlr, box("minf", box("stbl", joined({stsd, offsets})))})));
}
/// Chunks at 32-bit offsets in the video track, at 64-bit ones in the sound's.
Content index_of(std::uint64_t at, const Content& more = {}) {
  const Content stco = box("stco", joined({integer(2, 8), integer(at, 4), integer(at + 20, 4)}));
  const Content co64 = box("co64", joined({integer(1, 8), integer(at + 10, 8)}));
  const Content video = box("avc1", joined({Content(78, 7), box("avcC", Content(5, 9)), more}));
  return joined({box("mvhd", Content(100, 1)), track("vide", video, stco), track("soun", box("mp4a", {}), co64)});
}
const Content kMedia = text("mdat-chunk-number-0--chunk-number-1");

Content find(const Content& in, const std::string& words, std::size_t bytes) {
  const auto at = std::search(in.begin(), in.end(), words.begin(), words.end());
  if (at == in.end() || static_cast<std::size_t>(in.end() - at) < bytes) return {};
  return {at, at + static_cast<std::ptrdiff_t>(bytes)};
}
std::uint64_t number(const Content& in, const std::string& box, std::size_t at, std::size_t bytes) {
  std::uint64_t value = 0;
  const Content found = find(in, box, 4 + at + bytes);
  for (std::size_t k = 0; k < bytes && !found.empty(); ++k) value = value << 8 | found[4 + at + k];
  return value;
}

TEST(SphericalMp4, FileWithTheIndexBehindOrInFront_OffsetsFollowTheMedia) {
  const test::TemporaryFolder folder;
  const Content ftyp = box("ftyp", text("isom0000")), mdat = box("mdat", kMedia);
  const std::size_t size = index_of(0).size() + 8;
  for (const bool front : {true, false}) {
    const std::uint64_t media = ftyp.size() + (front ? size : 0) + 8;
    const Content moov = box("moov", index_of(media));
    const Content file = front ? joined({ftyp, moov, mdat}) : joined({ftyp, mdat, moov});
    test::write_bytes(folder / "a.mp4", file);
    for (const bool spherical : {true, false}) {
      std::filesystem::remove(folder / "b.mp4");
      const Status written = write_marked_mp4((folder / "a.mp4").string(), (folder / "b.mp4").string(), {spherical});
      ASSERT_TRUE(written) << written.error().message;
      const Content made = test::read_bytes(folder / "b.mp4");
      const std::uint64_t now = made.size() - kMedia.size();
      EXPECT_EQ(number(made, "stco", 8, 4), now);
      EXPECT_EQ(number(made, "stco", 12, 4), now + 20);
      EXPECT_EQ(number(made, "co64", 8, 8), now + 10);
      EXPECT_TRUE(std::equal(mdat.begin(), mdat.end(), made.end() - static_cast<std::ptrdiff_t>(mdat.size())));
      EXPECT_EQ(made.size() == file.size(), !spherical);
      EXPECT_EQ(made == file, !spherical && front);
    }
    EXPECT_EQ(test::read_bytes(folder / "a.mp4"), file);
  }
}

TEST(SphericalMp4, TheMetadata_IsWhereTheSpecificationsSay) {
  const Content proj = box("proj", joined({box("prhd", Content(16, 0)), box("equi", Content(20, 0))}));
  const Content svhd = box("svhd", joined({Content(4, 0), text("Nodal"), Content(1, 0)}));
  const Content v2 = joined({box("st3d", Content(5, 0)), box("sv3d", joined({svhd, proj}))});
  const Content made = marked_moov(index_of(1000, box("st3d", Content(5, 1))), {}, {true}).value();
  const Content expected = box("avc1", joined({Content(78, 7), box("avcC", Content(5, 9)), v2}));
  EXPECT_EQ(find(made, "avc1", expected.size() - 4), Content(expected.begin() + 4, expected.end()));
  // V1: the last box of the video track, which the sound's track follows.
  const Content id{0xff, 0xcc, 0x82, 0x63, 0xf8, 0x55, 0x4a, 0x93, 0x88, 0x14, 0x58, 0x7a, 0x02, 0x52, 0x1f, 0xdd};
  EXPECT_EQ(find(made, "uuid", 20), joined({text("uuid"), id}));
  constexpr std::size_t video = 108;  // behind mvhd
  const std::uint64_t length = number(joined({text("size"), Content(made.begin() + 108, made.end())}), "size", 0, 4);
  const std::string tail = "</rdf:SphericalVideo>";
  EXPECT_TRUE(std::equal(tail.rbegin(), tail.rend(), made.rend() - static_cast<std::ptrdiff_t>(video + length)));
  EXPECT_EQ(number(made, "stco", 8, 4), 1000u);
}

/// First-order ambisonics of four channels, as the RFC numbers them.
const Content kAmbisonic = joined({integer(0, 2), integer(1, 4), integer(0, 2), integer(4, 4), integer(0, 4),
                                   integer(1, 4), integer(2, 4), integer(3, 4)});

/// An index whose sound has a sample entry of this version of QuickTime's.
Content index_with_sound(int version, const Content& boxes) {
  const Content fields = joined({integer(1, 8), integer(static_cast<std::uint64_t>(version), 2),
                                 Content(version == 0   ? 18
                                         : version == 1 ? 34
                                                        : 54,
                                         6)});
  const Content co64 = box("co64", joined({integer(1, 8), integer(1000, 8)}));
  return joined(
      {track("vide", box("avc1", Content(78, 7)), co64), track("soun", box("mp4a", joined({fields, boxes})), co64)});
}

TEST(SphericalMp4, AmbisonicSound_IsReadAndWrittenInItsSampleEntry) {
  const test::TemporaryFolder folder;
  const std::string file = (folder / "a.mp4").string();
  const Content esds = box("esds", Content(9, 3)), sa3d = box("SA3D", kAmbisonic);
  for (const int version : {0, 1, 2}) {
    const Content plain = index_with_sound(version, esds), described = index_with_sound(version, joined({esds, sa3d}));
    EXPECT_EQ(marked_moov(plain, {}, {false, kAmbisonic}).value(), described) << version;
    test::write_bytes(folder / "a.mp4", joined({box("ftyp", text("isom0000")), box("moov", plain)}));
    EXPECT_EQ(ambisonic_of(file), Content()) << version;
    test::write_bytes(folder / "a.mp4", joined({box("ftyp", text("isom0000")), box("moov", described)}));
    EXPECT_EQ(ambisonic_of(file), kAmbisonic) << version;
  }
  Content other_version = kAmbisonic, too_many = kAmbisonic, cut = kAmbisonic;
  other_version[0] = 1;
  too_many[8] = 0x7F;
  cut.pop_back();
  for (const Content& wrong : {other_version, too_many, cut, Content(), Content(12, 0)}) {
    test::write_bytes(folder / "a.mp4", box("moov", index_with_sound(0, box("SA3D", wrong))));
    EXPECT_EQ(ambisonic_of(file), Content());
  }
  const Content whole = box("moov", index_with_sound(1, sa3d));
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    test::write_bytes(folder / "a.mp4", Content(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(bytes)));
    EXPECT_EQ(ambisonic_of(file), Content()) << bytes;
  }
  EXPECT_EQ(ambisonic_of((folder / "none.mp4").string()), Content());
}

TEST(SphericalMp4, AnOffsetOver32Bits_MakesTheTracksOffsetsWide) {
  const MovedRange moved{1010, 2000, std::int64_t{1} << 32};
  const Content made = marked_moov(index_of(1000), {&moved, 1}, {true}).value();
  EXPECT_TRUE(find(made, "stco", 4).empty());
  EXPECT_EQ(number(made, "co64", 8, 8), 1000u);
  EXPECT_EQ(number(made, "co64", 16, 8), 1020 + (std::uint64_t{1} << 32));
}

TEST(SphericalMp4, BoxesThatLie_AreOneErrorAndNoFile) {
  const test::TemporaryFolder folder;
  const Content whole = joined({box("ftyp", text("isom0000")), box("moov", index_of(1000)), box("mdat", kMedia)});
  const auto expect_refused = [&](const Content& file, const std::string& what) {
    test::write_bytes(folder / "a.mp4", file);
    const Status written = write_marked_mp4((folder / "a.mp4").string(), (folder / "b.mp4").string(), {true});
    ASSERT_FALSE(written) << what;
    EXPECT_NE(written.error().message.find("a.mp4"), std::string::npos) << written.error().message;
    EXPECT_EQ(written.error().message.find('\n'), std::string::npos) << what;
    EXPECT_FALSE(std::filesystem::exists(folder / "b.mp4")) << what;
    EXPECT_EQ(test::read_bytes(folder / "a.mp4"), file) << what;
  };
  for (const std::string type : {"mvhd", "trak", "mdia", "hdlr", "minf", "stbl", "stsd", "avc1", "avcC", "stco"}) {
    const auto at = std::search(whole.begin(), whole.end(), type.begin(), type.end()) - whole.begin() - 4;
    for (const std::uint64_t size : {0U, 1U, 7U, 0x7FFFFFFFU, 0xFFFFFFFFU}) {
      Content file = whole;
      std::ranges::copy(integer(size, 4), file.begin() + at);
      expect_refused(file, type + " " + std::to_string(size));
    }
  }
  for (std::size_t cut = 0; cut + kMedia.size() + 8 < whole.size(); ++cut) {
    expect_refused(Content(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut)), "cut");
  }
  const Content lying = joined({integer(1, 4), text("free"), integer(8, 8), box("moov", index_of(0))});
  expect_refused(lying, "a length of 64 bits below its own");
  expect_refused(box("moov", box("mvhd", {})), "no video track");
  Content deep;
  for (int k = 0; k < 9; ++k) deep = box("mdia", deep);
  expect_refused(box("moov", joined({index_of(0), deep})), "deep");
  Content deeper(8'000'000);
  for (std::size_t at = 0; at < deeper.size(); at += 8) {
    std::ranges::copy(joined({integer(deeper.size() - at, 4), text("mdia")}), deeper.begin() + static_cast<long>(at));
  }
  expect_refused(box("moov", deeper), "a million deep");
}

}  // namespace
}  // namespace nodal::film
