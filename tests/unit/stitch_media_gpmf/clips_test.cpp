// Two clips by GoPro: the gyro as exiftool reads it, and each clip's lag to a cut and shifted copy of itself.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>

#include "stitch/media/gpmf/gyro.h"
#include "stitch/timing/rotation_lag.h"
#include "tests/support/process.h"

namespace nodal::media {
namespace {

std::string clip(const std::string& name) { return std::string(NODAL_SHARED_DIR "/data/gpmf/") + name; }

bool installed(const std::string& program) {
  return test::Process({"sh", "-c", "command -v " + program}).wait().code == 0;
}

/// A clip's GPMF track, read by ffmpeg.
struct Track {
  std::string bytes{};
  std::vector<TimedPayload> payloads{};
};

void read_track(const std::string& path, Track& track) {
  const auto packets = test::Process({"ffprobe", "-v", "error", "-select_streams", "3", "-show_entries",
                                      "packet=pts_time,duration_time,size", "-of", "csv=p=0", path})
                           .wait();
  ASSERT_EQ(packets.code, 0) << packets.err;
  track.bytes =
      test::Process({"ffmpeg", "-v", "error", "-i", path, "-map", "0:3", "-c", "copy", "-f", "data", "-"}).wait().out;
  std::istringstream lines(packets.out);
  std::size_t at = 0;
  for (std::string line; std::getline(lines, line);) {
    TimedPayload payload;
    std::size_t size = 0;
    char comma = 0;
    std::istringstream(line) >> payload.time >> comma >> payload.duration >> comma >> size;
    ASSERT_LE(at + size, track.bytes.size());
    payload.bytes = {reinterpret_cast<const std::uint8_t*>(track.bytes.data()) + at, size};
    at += size;
    track.payloads.push_back(payload);
  }
}

class Clips : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(clip(GetParam()))) GTEST_SKIP() << "test data not there: ../shared/data/gpmf";
    if (!installed("ffmpeg") || !installed("ffprobe")) GTEST_SKIP() << "ffmpeg is not installed";
    read_track(clip(GetParam()), track_);
    ASSERT_GE(track_.payloads.size(), 10u);
  }
  Track track_;
};

TEST_P(Clips, Speeds_AreThoseOfExiftool) {
  if (!installed("exiftool")) GTEST_SKIP() << "exiftool is not installed";
  const auto gyro = read_gyro(track_.payloads);
  ASSERT_TRUE(gyro) << gyro.error().text();
  const auto said = test::Process({"exiftool", "-ee", "-b", "-a", "-Gyroscope", clip(GetParam())}).wait();
  ASSERT_EQ(said.code, 0);
  std::string text = said.out;
  // A payload's last number and the next one's first are not apart; lines or spaces are between the others.
  std::istringstream numbers(text);
  std::vector<double> values;
  for (double x = 0; numbers >> x;) values.push_back(x);
  ASSERT_EQ(values.size(), 3 * gyro->speeds.size());
  for (std::size_t i = 0; i < gyro->speeds.size(); ++i) {
    EXPECT_NEAR(gyro->speeds[i], std::hypot(values[3 * i], values[3 * i + 1], values[3 * i + 2]), 1e-9) << i;
  }
}

TEST_P(Clips, PartOfTheGyroOnAnotherClock_HasThatLag) {
  const auto whole = read_gyro(track_.payloads);
  ASSERT_TRUE(whole) << whole.error().text();
  timing::Rotation part;
  for (std::size_t i = 150; i < whole->times.size(); ++i) {
    part.times.push_back((whole->times[i] - 1.2345) * (1 + 80e-6));
    part.speeds.push_back(whole->speeds[i]);
  }
  const auto lag = timing::rotation_lag({whole->times, whole->speeds}, part, {});
  ASSERT_TRUE(lag) << lag.error().text();
  for (const double at : {2.0, 6.0, 10.0}) EXPECT_NEAR(lag->value(at), (at - 1.2345) * (1 + 80e-6) - at, 0.1e-3) << at;
}

TEST_P(Clips, PayloadsWithoutTheFirst_GiveThatLagAsWellAsPayloadsSayTheirTimes) {
  const auto whole = read_gyro(track_.payloads);
  ASSERT_TRUE(whole) << whole.error().text();
  std::vector<TimedPayload> rest(track_.payloads.begin() + 1, track_.payloads.end());
  for (TimedPayload& p : rest) p.time = (p.time - 1.2345) * (1 + 80e-6), p.duration *= 1 + 80e-6;
  const auto cut = read_gyro(rest);
  ASSERT_TRUE(cut) << cut.error().text();
  const auto lag = timing::rotation_lag({whole->times, whole->speeds}, {cut->times, cut->speeds}, {});
  ASSERT_TRUE(lag) << lag.error().text();
  // Counts of payloads differ by several samples of 2.5 or 5 ms, so the line through ten others is another one.
  EXPECT_NEAR(lag->value(6), (6 - 1.2345) * (1 + 80e-6) - 6, 2e-3);
}

INSTANTIATE_TEST_SUITE_P(GoPro, Clips, testing::Values("karma.mp4", "max-heromode.mp4"),
                         [](const auto& clip) { return std::string(clip.param).substr(0, 3); });

}  // namespace
}  // namespace nodal::media
