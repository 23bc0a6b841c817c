// GPMF payloads written by hand from its specification (gopro/gpmf-parser, README).
#include "stitch/media/gpmf/gyro.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <string_view>

namespace nodal::media {
namespace {

/// An item: key, type, size of a structure, count, value, zeros up to a multiple of four bytes.
std::string item(std::string_view key, char type, std::size_t size, std::string_view value) {
  const std::size_t count = size == 0 ? 0 : value.size() / size;
  std::string bytes(key);
  bytes += {type, static_cast<char>(size), static_cast<char>(count >> 8), static_cast<char>(count & 0xFF)};
  bytes += value;
  bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
  return bytes;
}
std::string items(std::string_view key, std::string_view value) { return item(key, '\0', 1, value); }
std::string words(std::initializer_list<int> values) {
  std::string bytes;
  for (const int x : values) bytes += {static_cast<char>((x >> 8) & 0xFF), static_cast<char>(x & 0xFF)};
  return bytes;
}
std::string number(std::uint32_t x) {
  return {static_cast<char>(x >> 24), static_cast<char>(x >> 16 & 0xFF), static_cast<char>(x >> 8 & 0xFF),
          static_cast<char>(x & 0xFF)};
}
std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
Result<GyroSamples> read(const std::string& text) { return read_gyro(bytes_of(text)); }

std::string stream(const std::string& values, std::uint32_t total, const std::string& scale = words({400})) {
  return items("STRM", item("TSMP", 'L', 4, number(total)) + item("STNM", 'c', 1, "Gyroscope") +
                           item("SIUN", 'c', 5, "rad/s") + item("SCAL", 's', 2, scale) + item("GYRO", 's', 6, values));
}
std::string payload(int first, int count, std::uint32_t total) {
  std::string values;
  for (int i = 0; i < count; ++i) values += words({first + i, 0, 0});
  return items("DEVC", item("DVID", 'L', 4, number(1)) + stream(values, total));
}

TEST(ReadGyro, OneStreamAmongOthers_ValuesAreDividedByTheScale) {
  const std::string other = items("STRM", item("SCAL", 's', 2, words({7})) + item("ACCL", 's', 6, words({1, 2, 3})));
  const auto samples = read(items("DEVC", other + stream(words({400, -800, 0, 200, 100, -32768}), 1234)));
  ASSERT_TRUE(samples) << samples.error().text();
  ASSERT_EQ(samples->rates.size(), 2u);
  EXPECT_EQ(samples->rates[0], (std::array<double, 3>{1, -2, 0}));
  EXPECT_EQ(samples->rates[1], (std::array<double, 3>{0.5, 0.25, -81.92}));
  EXPECT_EQ(samples->total, 1234u);
}

TEST(ReadGyro, ScaleOfEachAxisAndDegrees_AreApplied) {
  const auto samples = read(stream(words({100, 100, 100}), 1, words({100, 50, -25})));
  ASSERT_TRUE(samples);
  EXPECT_EQ(samples->rates[0], (std::array<double, 3>{1, 2, -4}));
  const auto degrees = read(items("STRM", item("SIUN", 'c', 5, "deg/s") + item("SCAL", 's', 2, words({1})) +
                                              item("GYRO", 's', 6, words({180, 0, 0}))));
  ASSERT_TRUE(degrees);
  EXPECT_NEAR(degrees->rates[0][0], 3.141592653589793, 1e-15);
}

TEST(ReadGyro, PayloadsThatAreWrong_AreRefusedWithTheKey) {
  const auto code = [](const std::string& text) {
    const auto samples = read(text);
    return samples ? Errc::kInternal : samples.error().code;
  };
  EXPECT_EQ(code(""), Errc::kMissingField);
  EXPECT_EQ(code(items("DEVC", item("DVID", 'L', 4, number(1)))), Errc::kMissingField);
  EXPECT_EQ(code("DEVC"), Errc::kTruncated);
  EXPECT_EQ(code(stream(words({1, 2, 3}), 1, words({0}))), Errc::kBadValue);
  EXPECT_EQ(code(stream(words({1, 2, 3}), 1, words({1, 2}))), Errc::kBadValue);
  EXPECT_EQ(code(items("STRM", item("GYRO", 's', 6, words({1, 2, 3})))), Errc::kBadValue);
  const std::string scale = item("SCAL", 's', 2, words({1}));
  EXPECT_EQ(code(items("STRM", scale + item("GYRO", 's', 4, words({1, 2})))), Errc::kUnsupported);
  EXPECT_EQ(code(items("STRM", scale + item("GYRO", 'b', 3, "abc"))), Errc::kUnsupported);
  EXPECT_EQ(code(items("STRM", scale + item("GYRO", 'f', 12, number(0x7FC00000) + number(0) + number(0)))),
            Errc::kBadValue);  // not a number
  std::string nested;
  for (int i = 0; i < 30; ++i) nested = items("DEVC", nested);
  EXPECT_EQ(code(nested), Errc::kBadFormat);
}

TEST(ReadGyro, CutAnywhere_IsTruncatedOrHasNothing) {
  const std::string whole = payload(1, 5, 5);
  ASSERT_TRUE(read(whole));
  for (std::size_t n = 0; n + 1 < whole.size(); ++n) EXPECT_FALSE(read(whole.substr(0, n))) << n;
}

/// Payloads of a gyro at 200 Hz whose payloads hold some samples more or fewer than a second has.
struct Film {
  std::vector<std::string> bytes{};
  std::vector<TimedPayload> payloads{};
  Film(std::initializer_list<int> counts, bool counted) {
    std::uint32_t total = 0;
    for (const int count : counts) {
      bytes.push_back(payload(static_cast<int>(total), count, counted ? total + static_cast<std::uint32_t>(count) : 0));
      total += static_cast<std::uint32_t>(count);
    }
    total = 0;
    std::size_t i = 0;
    for (const int count : counts) {
      payloads.push_back({3 + total / 200.0, count / 200.0, bytes_of(bytes[i++])});
      total += static_cast<std::uint32_t>(count);
    }
  }
};

TEST(ReadGyroOfAFilm, PayloadsOfUnequalCounts_TimesAreEven) {
  for (const bool counted : {true, false}) {
    const Film film({198, 203, 199, 201}, counted);
    const auto gyro = read_gyro(film.payloads);
    ASSERT_TRUE(gyro) << gyro.error().text();
    ASSERT_EQ(gyro->times.size(), 801u);
    for (std::size_t i = 0; i < gyro->times.size(); ++i) {
      EXPECT_NEAR(gyro->times[i], 3 + static_cast<double>(i) / 200, 1e-9);
      EXPECT_NEAR(gyro->speeds[i], static_cast<double>(i) / 400, 1e-12);
    }
  }
}

TEST(ReadGyroOfAFilm, PayloadLost_TimesGoOnWhereItsCountSays) {
  Film film({200, 200, 200, 200, 200}, true);
  film.payloads.erase(film.payloads.begin() + 2);
  const auto gyro = read_gyro(film.payloads);
  ASSERT_TRUE(gyro);
  EXPECT_NEAR(gyro->times[399], 3 + 399 / 200.0, 1e-9);
  EXPECT_NEAR(gyro->times[400], 3 + 600 / 200.0, 1e-9);
}

TEST(ReadGyroOfAFilm, TimesThatCannotBe_AreRefused) {
  Film film({200, 200, 200}, true);
  for (TimedPayload& p : film.payloads) p.time = 5;
  EXPECT_FALSE(read_gyro(film.payloads));
  film.payloads[0].time = std::nan("");
  EXPECT_FALSE(read_gyro(film.payloads));
  EXPECT_FALSE(read_gyro(std::span<const TimedPayload>{}));
}

}  // namespace
}  // namespace nodal::media
