// Films that the page shows: their pictures and times, of files that this program and FFmpeg wrote, whole, cut and
// damaged.
#include "host_tool/look/film.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "host_tool/look/sphere.h"
#include "tests/support/film.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::host::look {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Json = nlohmann::json;

class FilmFile : public testing::Test {
 protected:
  static Bytes jpeg(int seed) {
    return test::jpeg_of(test::smooth_rgb(128, 64, seed), 128, 64, test::Sampling::k420, 80);
  }
  /// A film of pictures 40 ms apart, but for the last, which comes 120 ms later.
  std::string write_film(const std::string& name, int pictures, bool equirectangular = true) const {
    take::VideoTrack track;
    track.width = 128;
    track.height = 64;
    track.equirectangular = equirectangular;
    std::vector<test::TimedPicture> all;
    for (int k = 0; k < pictures; ++k) {
      const auto step = static_cast<std::uint64_t>(k) + (k == pictures - 1 ? 2 : 0);
      all.push_back({5'000'000'000U + step * 40'000'000U, jpeg(k)});
    }
    test::write_bytes(folder_ / name, test::film_of(track, all));
    return (folder_ / name).string();
  }
  static std::string why_not(const std::string& file) {
    const auto film = open_film(file);
    EXPECT_FALSE(film);
    return film ? "" : film.error().message;
  }

  test::TemporaryFolder folder_;
};

TEST_F(FilmFile, OfThisProgram_HasItsPicturesAndTimes) {
  const std::string file = write_film("own.mkv", 12);
  ASSERT_TRUE(is_film(file));
  const auto film = open_film(file).value();
  ASSERT_EQ(film->times().size(), 12u);
  for (std::size_t k = 0; k < 11; ++k) EXPECT_EQ(film->times()[k], static_cast<std::int64_t>(k) * 40'000'000) << k;
  EXPECT_EQ(film->times()[11], 13 * 40'000'000LL);
  for (const int k : {0, 11, 5, 6}) EXPECT_EQ(film->frame(static_cast<std::size_t>(k)).value(), jpeg(k)) << k;
  EXPECT_EQ(film->layout(), "equirectangular");
  EXPECT_EQ(open_film(write_film("heads.mkv", 2, false)).value()->layout(), "");
  std::filesystem::remove(file);
  EXPECT_EQ(film->frame(3).value(), jpeg(3)) << "the file stays open";
}

TEST_F(FilmFile, OfFfmpeg_HasThePicturesThatFfmpegFinds) {
  const std::string mkv = (folder_ / "peer.mkv").string(), bare = (folder_ / "peer.mjpeg").string();
  const auto ffmpeg = [](std::vector<std::string> words) {
    words.insert(words.begin(), {"ffmpeg", "-v", "error", "-y"});
    return test::Process(words).wait().code;
  };
  if (ffmpeg({"-f", "lavfi", "-i", "testsrc=size=128x64:rate=25:duration=2", "-c:v", "mjpeg", mkv}) != 0)
    GTEST_SKIP() << "ffmpeg is not installed";
  ASSERT_EQ(ffmpeg({"-i", mkv, "-c", "copy", "-f", "mjpeg", bare}), 0);
  const auto film = open_film(mkv).value();
  ASSERT_EQ(film->times().size(), 50u);
  EXPECT_NEAR(static_cast<double>(film->times().back()), 49 * 40e6, 1e6);
  Bytes all;
  for (std::size_t k = 0; k < 50; ++k) {
    const Bytes frame = film->frame(k).value();
    all.insert(all.end(), frame.begin(), frame.end());
  }
  EXPECT_EQ(all, test::read_bytes(bare));
  ASSERT_EQ(ffmpeg({"-i", mkv, "-c:v", "mpeg4", (folder_ / "other.mkv").string()}), 0);
  EXPECT_NE(why_not((folder_ / "other.mkv").string()).find("-c:v mjpeg"), std::string::npos);
}

TEST_F(FilmFile, CutAnywhere_HasThePicturesThatAreWhole) {
  const Bytes whole = test::read_bytes(write_film("whole.mkv", 6));
  std::size_t most = 0;
  for (std::size_t length = 0; length < whole.size(); length += 61) {
    test::write_bytes(folder_ / "cut.mkv", Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)));
    const auto film = open_matroska((folder_ / "cut.mkv").string());
    if (!film) continue;
    const std::size_t count = (*film)->times().size();
    EXPECT_GE(count, most) << length;
    most = count;
    EXPECT_EQ((*film)->frame(count - 1).value(), jpeg(static_cast<int>(count) - 1)) << length;
  }
  EXPECT_EQ(most, 6u);
}

TEST_F(FilmFile, Damaged_IsRefusedOrShowsWhatItHas) {
  const Bytes whole = test::read_bytes(write_film("whole.mkv", 4));
  std::mt19937 random(45);
  for (int k = 0; k < 3000; ++k) {
    Bytes file = whole;
    for (int j = 0; j < 3; ++j)
      file[random() % std::min<std::size_t>(file.size(), 1800)] = static_cast<std::uint8_t>(random());
    test::write_bytes(folder_ / "damaged.mkv", file);
    const auto film = open_matroska((folder_ / "damaged.mkv").string());
    if (!film) continue;
    EXPECT_TRUE(std::ranges::is_sorted((*film)->times()));
    for (std::size_t n = 0; n < (*film)->times().size(); ++n) (void)(*film)->frame(n);
  }
}

TEST_F(FilmFile, TimesInUnitsOfCenturies_AreRefused) {
  test::write_bytes(folder_ / "slow.mkv", {0x1A, 0x45, 0xDF, 0xA3, 0x80,                          // EBML header
                                           0x18, 0x53, 0x80, 0x67, 0xFF,                          // segment
                                           0x15, 0x49, 0xA9, 0x66, 0x8C, 0x2A, 0xD7, 0xB1, 0x88,  // its unit of time
                                           0x7F, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF});
  const auto film = open_matroska((folder_ / "slow.mkv").string());
  ASSERT_FALSE(film);
  EXPECT_NE(film.error().message.find("units of more than a second"), std::string::npos) << film.error().message;
}

TEST_F(FilmFile, BecomesShorterWhileItIsShown_IsAnErrorWithItsName) {
  const std::string file = write_film("own.mkv", 12);
  const auto film = open_film(file).value();
  std::filesystem::resize_file(file, 4000);
  const auto last = film->frame(11);
  ASSERT_FALSE(last);
  EXPECT_NE(last.error().message.find("own.mkv: became shorter"), std::string::npos) << last.error().message;
}

TEST_F(FilmFile, IsAnsweredPictureByPicture) {
  const auto sphere = Sphere::read({write_film("own.mkv", 12), "", usual_envelopes(), 1}).value();
  const auto json = [&](const std::string& name) {
    const Answer answer = sphere->answer({name, {}});
    return Json::parse(answer.body->begin(), answer.body->end());
  };
  EXPECT_EQ(json("scene.json")["pictures"], 12);
  EXPECT_EQ(json("scene.json")["layout"], "equirectangular");
  EXPECT_EQ(json("times.json"), Json({40, 40, 40, 40, 40, 40, 40, 40, 40, 40, 120}));
  const Answer seventh = sphere->answer({"frame", {{"k", "7"}}});
  EXPECT_EQ(seventh.type, "image/jpeg");
  EXPECT_EQ(*seventh.body, jpeg(7));
  EXPECT_EQ(sphere->answer({"mesh.glb", {{"envelope", "0"}}}).status, 200u);
  for (const std::string k : {"12", "-1", "", "x"}) EXPECT_EQ(sphere->answer({"frame", {{"k", k}}}).status, 400u) << k;
  const auto unsaid = Sphere::read({write_film("heads.mkv", 2, false), "", usual_envelopes(), 1});
  ASSERT_FALSE(unsaid);
  EXPECT_NE(unsaid.error().message.find("--from"), std::string::npos);
  const auto said = Sphere::read({write_film("heads.mkv", 2, false), "equirectangular", usual_envelopes(), 1});
  EXPECT_TRUE(said) << "the user says the layout";
}

}  // namespace
}  // namespace nodal::host::look
