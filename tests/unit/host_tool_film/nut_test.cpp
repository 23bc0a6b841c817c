// Pictures and times from a decoder's pipe: streams of ffmpeg's and such that are written by the NUT specification,
// whole, cut and damaged.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "host_tool/film/nut_reader.h"
#include "nut_stream.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"
#include "tests/support/within_memory.h"

namespace nodal::film {
namespace {

struct Got {
  std::optional<NutVideo> video;
  std::vector<std::int64_t> times;
  std::vector<Bytes> pictures;
  Status status;
};

/// Reads a stream that comes in pieces, with pictures of `size` bytes.
Got read_all(const Bytes& stream, std::size_t size, std::size_t piece = SIZE_MAX) {
  std::size_t at = 0;
  NutReader reader([&](std::span<std::uint8_t> into) -> Result<std::size_t> {
    const std::size_t count = std::min({into.size(), piece, stream.size() - at});
    std::copy_n(stream.begin() + static_cast<std::ptrdiff_t>(at), count, into.begin());
    at += count;
    return count;
  });
  Got got;
  const auto video = reader.begin();
  if (!video) {
    got.status = fail(video.error());
    return got;
  }
  got.video = *video;
  for (;;) {
    Bytes picture(size);
    const auto time = reader.next(picture);
    if (!time) got.status = fail(time.error());
    if (!time || !*time) return got;
    got.times.push_back(**time);
    got.pictures.push_back(std::move(picture));
  }
}

Bytes picture(int seed, std::size_t size = 8) {
  Bytes made(size);
  std::mt19937 random(static_cast<unsigned>(seed));
  std::ranges::generate(made, [&] { return static_cast<std::uint8_t>(random()); });
  return made;
}

/// Four pictures of 4x2 pixels; `ends`: after which bytes a reader may find the end.
Bytes four_pictures(std::vector<std::size_t>* ends = nullptr) {
  Nut nut;
  const auto end = [&] {
    if (ends) ends->push_back(nut.bytes.size());
  };
  nut.headers(4, 2);
  end();
  nut.syncpoint(90000, 0);
  end();
  nut.frame(90000, picture(0));
  end();
  nut.next_frame(picture(1));
  end();
  nut.near_frame(90000 + Nut::kStep + 40, picture(2));
  end();
  nut.packet(Nut::kInfo, Bytes(5000, 'N'));
  end();
  nut.syncpoint(2500, 1);
  end();
  nut.near_frame(225000 - 60, picture(3));
  end();
  return nut.bytes;
}

void expect_refused(const Bytes& stream, Errc code, const std::string& words) {
  EXPECT_TRUE(test::within_memory(8, [&] { return !read_all(stream, 8).status.has_value(); })) << words;
  const Got got = read_all(stream, 8);
  ASSERT_FALSE(got.status) << words;
  EXPECT_EQ(got.status.error().code, code) << got.status.error().message;
  EXPECT_NE(got.status.error().message.find(words), std::string::npos) << got.status.error().message;
}

TEST(Nut, WrittenByTheSpecification_HasItsTimesAndBytesHoweverItComes) {
  const Bytes stream = four_pictures();
  for (const std::size_t piece : {SIZE_MAX, std::size_t{1}, std::size_t{7}}) {
    const Got got = read_all(stream, 8, piece);
    ASSERT_TRUE(got.status) << got.status.error().message;
    EXPECT_EQ(got.video->width, 4);
    EXPECT_EQ(got.video->height, 2);
    EXPECT_EQ(got.video->time_base, (Rational{1, 90000}));
    EXPECT_EQ(got.times, (std::vector<std::int64_t>{90000, 93003, 93043, 224940}));
    for (int k = 0; k < 4; ++k) EXPECT_EQ(got.pictures.at(static_cast<std::size_t>(k)), picture(k)) << k;
  }
}

TEST(Nut, OfFfmpeg_HasExactTimesAndTheBytesOfRawVideo) {
  const test::TemporaryFolder folder;
  const std::string nut = (folder / "a.nut").string(), raw = (folder / "a.raw").string();
  const auto ffmpeg = [](const std::string& format, const std::string& file) {
    return test::Process({"ffmpeg",
                          "-v",
                          "error",
                          "-f",
                          "lavfi",
                          "-i",
                          "testsrc=size=80x48:rate=25",
                          "-vf",
                          "format=yuv420p,settb=1/90000,setpts=N*(N+5)*1001+31",
                          "-frames:v",
                          "30",
                          "-fps_mode",
                          "passthrough",
                          "-enc_time_base",
                          "1/90000",
                          "-c:v",
                          "rawvideo",
                          "-f",
                          format,
                          file})
        .wait()
        .code;
  };
  if (ffmpeg("nut", nut) != 0) GTEST_SKIP() << "ffmpeg is not installed";
  ASSERT_EQ(ffmpeg("rawvideo", raw), 0);
  const Bytes stream = test::read_bytes(nut);
  const Got got = read_all(stream, 80 * 48 * 3 / 2);
  ASSERT_TRUE(got.status) << got.status.error().message;
  ASSERT_EQ(got.times.size(), 30u);
  Bytes all;
  for (std::size_t k = 0; k < 30; ++k) {
    const auto n = static_cast<std::int64_t>(k);
    EXPECT_EQ(compare(got.times[k], got.video->time_base, n * (n + 5) * 1001 + 31, {1, 90000}), 0) << k;
    all.insert(all.end(), got.pictures[k].begin(), got.pictures[k].end());
  }
  EXPECT_EQ(all, test::read_bytes(raw));
  for (std::size_t cut = 0; cut < stream.size(); cut += 501) {
    const Got part = read_all(Bytes(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(cut)), 5760);
    ASSERT_LE(part.times.size(), 30u);
    EXPECT_TRUE(std::equal(part.times.begin(), part.times.end(), got.times.begin())) << cut;
    if (!part.status) {
      EXPECT_EQ(part.status.error().code, Errc::kTruncated) << cut;
    }
  }
}

TEST(Nut, CutAtEveryByte_IsTruncatedUnlessAFrameIsWholeThere) {
  std::vector<std::size_t> ends;
  const Bytes whole = four_pictures(&ends);
  for (std::size_t cut = 0; cut <= whole.size(); ++cut) {
    const Got got = read_all(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut)), 8);
    EXPECT_EQ(got.status.has_value(), std::ranges::find(ends, cut) != ends.end()) << cut;
    if (!got.status) {
      EXPECT_EQ(got.status.error().code, Errc::kTruncated) << cut;
    }
    for (std::size_t k = 0; k < got.pictures.size(); ++k) EXPECT_EQ(got.pictures[k], picture(static_cast<int>(k)));
  }
}

TEST(Nut, AnElisionHeader_IsTheBeginningOfSmallFramesOnly) {
  Nut small;
  small.headers(4, 2);
  small.syncpoint(0, 0);
  for (const int byte : {int{Nut::kElided}, 0x81, 0, 8, 1, 1, 2, 3, 4, 5, 6}) {  // time 0, 8 bytes, header 1
    small.bytes.push_back(static_cast<std::uint8_t>(byte));
  }
  const Got got = read_all(small.bytes, 8);
  ASSERT_TRUE(got.status) << got.status.error().message;
  EXPECT_EQ(got.pictures.at(0), (Bytes{0xEE, 0xDD, 1, 2, 3, 4, 5, 6}));

  Nut large;  // over 4096 bytes, the index means nothing
  large.headers(4097, 1);
  large.syncpoint(0, 0);
  for (const int byte : {int{Nut::kElided}, 0x81, 0, 0xA0, 1, 1}) {
    large.bytes.push_back(static_cast<std::uint8_t>(byte));
  }
  const Bytes content = picture(9, 4097);
  large.bytes.insert(large.bytes.end(), content.begin(), content.end());
  const Got whole = read_all(large.bytes, 4097);
  ASSERT_TRUE(whole.status) << whole.status.error().message;
  EXPECT_EQ(whole.pictures.at(0), content);
}

TEST(Nut, HeadersThatLie_AreRefusedWithoutMemory) {
  const auto with_main = [](const Bytes& main) {
    Nut nut;
    nut.id();
    nut.packet(Nut::kMain, main);
    return nut.bytes;
  };
  const auto with_codes = [&](const Bytes& codes) {
    Bytes main = Nut::numbers({3, 1, 65536, 1, 1, 25});
    main.insert(main.end(), codes.begin(), codes.end());
    return with_main(main);
  };
  const auto with_stream = [](const Bytes& stream) {
    Nut nut;
    nut.id();
    nut.packet(Nut::kMain, Nut::main_header());
    nut.packet(Nut::kStream, stream);
    return nut.bytes;
  };
  const auto with_length = [](std::uint64_t code, std::uint64_t length) {
    Nut nut;
    nut.headers(4, 2);
    Nut::big_endian(nut.bytes, code, 8);
    Nut::number(nut.bytes, length);
    nut.bytes.resize(nut.bytes.size() + 100);
    return nut.bytes;
  };
  const std::uint64_t huge = (std::uint64_t{1} << 62) + 9;
  expect_refused(Bytes(100, 'n'), Errc::kBadFormat, "not NUT");
  expect_refused(with_length(Nut::kMain, huge), Errc::kTooLarge, "64 KiB");
  expect_refused(with_length(Nut::kSync, 65537), Errc::kTooLarge, "64 KiB");
  expect_refused(with_length(Nut::kSync, 3), Errc::kBadFormat, "checksum");
  expect_refused(with_length(Nut::kInfo, huge), Errc::kTruncated, "ends");
  expect_refused(with_length(Nut::kInfo + 1, 4), Errc::kBadFormat, "unknown kind");
  expect_refused(with_main(Nut::numbers({4})), Errc::kUnsupported, "version 3");
  expect_refused(with_main(Nut::numbers({3, 2})), Errc::kBadFormat, "one stream");
  expect_refused(with_main(Nut::numbers({3, 1, 9, 0})), Errc::kBadFormat, "time bases");
  expect_refused(with_main(Nut::numbers({3, 1, 9, huge})), Errc::kBadFormat, "time bases");
  expect_refused(with_main(Nut::numbers({3, 1, 9, 1, 1, 0})), Errc::kBadFormat, "a time base");
  expect_refused(with_main(Nut::numbers({3, 1, 9, 1, huge, 1})), Errc::kBadFormat, "a time base");
  expect_refused(with_codes(Nut::numbers({0, huge})), Errc::kBadFormat, "frame codes");
  expect_refused(with_codes(Nut::numbers({0, 6, 0, 1, 0, 0, 0, 0})), Errc::kBadFormat, "frame codes");
  expect_refused(with_codes(Nut::numbers({0, 6, 0, 1, 0, 0, 0, huge})), Errc::kBadFormat, "frame codes");
  expect_refused(with_codes(Nut::numbers({0, 6, huge, 1, 0, 0, 0, 255})), Errc::kBadFormat, "frame codes");
  expect_refused(with_codes(Nut::numbers({0, 6, 0, huge, 0, 0, 0, 255})), Errc::kBadFormat, "frame codes");
  expect_refused(with_codes(Nut::numbers({0, 0})), Errc::kBadFormat, "frame codes");
  Bytes elided = Nut::frame_codes();
  for (const std::uint64_t value : {std::uint64_t{1}, huge}) Nut::number(elided, value);
  expect_refused(with_codes(elided), Errc::kBadFormat, "main header");
  elided = Nut::frame_codes();
  Nut::number(elided, huge);
  expect_refused(with_codes(elided), Errc::kBadFormat, "elision");
  expect_refused(with_stream(Nut::stream_header(0, 2)), Errc::kBadFormat, "size of its pictures");
  expect_refused(with_stream(Nut::stream_header(4, huge)), Errc::kBadFormat, "size of its pictures");
  expect_refused(with_stream(Nut::numbers({0, 0, huge})), Errc::kBadFormat, "stream header");
  expect_refused(with_stream(Nut::numbers({0, 0, 0, 2, 7, 0, 0, 0, 0, 4, 2})), Errc::kBadFormat, "stream header");
  expect_refused(with_stream(Nut::numbers({0, 0, 0, 0, 16, 0, 0, 0, 0, 4, 2})), Errc::kBadFormat, "stream header");
}

TEST(Nut, FramesThatLie_AreRefused) {
  const auto with_frame = [](std::initializer_list<int> bytes) {
    Nut nut;
    nut.headers(4, 2);
    nut.syncpoint(0, 0);
    for (const int byte : bytes) nut.bytes.push_back(static_cast<std::uint8_t>(byte));
    nut.bytes.resize(nut.bytes.size() + 100);
    return nut.bytes;
  };
  expect_refused(with_frame({0}), Errc::kBadFormat, "not in use");
  expect_refused(with_frame({Nut::kWritten, 0, 9}), Errc::kBadFormat, "picture size changes");
  expect_refused(with_frame({Nut::kWritten, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F}), Errc::kBadFormat, "size of a frame");
  expect_refused(with_frame({Nut::kWritten, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F, 8}), Errc::kBadFormat,
                 "time of a frame");
  expect_refused(with_frame({Nut::kWritten, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1}), Errc::kBadFormat,
                 "63 bits");
  expect_refused(with_frame({Nut::kElided, 0, 8, 2}), Errc::kBadFormat, "another stream");
  Nut sync;
  sync.headers(4, 2);
  sync.syncpoint(std::uint64_t{1} << 61, 0);
  expect_refused(sync.bytes, Errc::kBadFormat, "time of a syncpoint");
}

TEST(Nut, DamagedAnywhere_EndsWithTimesInRange) {
  const Bytes whole = four_pictures();
  std::mt19937 random(7);
  for (int k = 0; k < 20000; ++k) {
    Bytes stream = whole;
    for (int j = 0; j < 3; ++j) stream[random() % stream.size()] = static_cast<std::uint8_t>(random());
    for (const std::int64_t time : read_all(stream, 8).times) EXPECT_LE(std::abs(time), std::int64_t{1} << 60);
  }
}

}  // namespace
}  // namespace nodal::film
