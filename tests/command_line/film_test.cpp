// `nodal raymap pull --out film.mkv` on a running rig.
#include <cstdlib>
#include <thread>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

class FilmTest : public RigTest {
 protected:
  void SetUp() override {
    if (Process({"sh", "-c", "command -v ffprobe"}).wait().code != 0) GTEST_SKIP() << "ffprobe is not installed";
    start_nodald();
    bring_up();
  }
  /// What ffprobe says about the film's stream, without a warning.
  std::string probed(const std::string& entries) const {
    const Finished run = Process({"ffprobe", "-v", "warning", "-count_packets", "-show_entries", "stream=" + entries,
                                  "-of", "default=nk=1:nw=1", path("film.mkv")})
                             .wait();
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_EQ(run.err, "");
    return run.out;
  }
};

TEST_F(FilmTest, Pulled_PlaysEveryRaymapAsTheSphereThatItIs) {
  const std::vector<Json> said = nodal_json({"raymap", "pull", "-n", "20", "--lossless", "--out", path("film.mkv")});
  EXPECT_EQ(said.back()["summary"]["pulled"], 20);
  EXPECT_EQ(probed("codec_name,nb_read_packets"), "mjpeg\n20\n");
  const Finished side = Process({"ffprobe", "-v", "error", "-show_streams", "-show_format", path("film.mkv")}).wait();
  EXPECT_NE(side.out.find("projection=equirectangular"), std::string::npos) << side.out;
  // The duration: from the first exposure to the last, and as long again as the last one is shown.
  const double exposures = said.back()["summary"]["exposure_seconds"];
  const auto at = side.out.rfind("duration=");
  ASSERT_NE(at, std::string::npos);
  EXPECT_NEAR(std::atof(side.out.c_str() + at + 9), exposures * 20 / 19, 0.02);
}

TEST_F(FilmTest, StoppedByCtrlC_IsWholeAndHasItsIndex) {
  const auto pull = start({"raymap", "pull", "--continuous", "--out", path("film.mkv")});
  ASSERT_TRUE(wait_until([&] {
    return std::filesystem::exists(path("film.mkv")) && std::filesystem::file_size(path("film.mkv")) > 20'000;
  }));
  pull->signal(SIGINT);
  EXPECT_EQ(pull->wait().code, 0);
  EXPECT_GT(std::stoi(probed("nb_read_packets")), 1);
  EXPECT_NE(read("film.mkv").find("\x1C\x53\xBB\x6B"), std::string::npos) << "the index";
}

TEST_F(FilmTest, Killed_PlaysUpToTheLastQuarterSecond) {
  const auto pull = start({"raymap", "pull", "--continuous", "--out", path("film.mkv")});
  ASSERT_TRUE(wait_until([&] {
    return std::filesystem::exists(path("film.mkv")) && std::filesystem::file_size(path("film.mkv")) > 20'000;
  }));
  pull->signal(SIGKILL);
  pull->wait();
  EXPECT_GT(std::stoi(probed("nb_read_packets")), 1);
}

TEST_F(FilmTest, WithoutARaymap_KeepsTheFilmThatIsThereAndLeavesNoEmptyOne) {
  write("film.mkv", "yesterday's film");
  EXPECT_NE(nodal({"--rig", "unix:" + path("nowhere.sock"), "raymap", "pull", "--out", path("film.mkv")}).code, 0);
  EXPECT_NE(nodal({"--rig", "unix:" + path("nowhere.sock"), "raymap", "pull", "--out", path("new.mkv")}).code, 0);
  EXPECT_EQ(read("film.mkv"), "yesterday's film");
  EXPECT_FALSE(std::filesystem::exists(path("new.mkv")));
  EXPECT_EQ(nodal({"raymap", "pull", "-n", "3", "--out", path("film.mkv")}).code, 0);
  EXPECT_EQ(probed("nb_read_packets"), "3\n");
}

TEST_F(FilmTest, OfAnotherFormatOrWhereNoneCanBe_IsRefusedWithTheReason) {
  const Finished png = nodal({"raymap", "pull", "--format", "png", "--out", path("film.mkv")});
  EXPECT_NE(png.code, 0);
  EXPECT_NE(png.err.find("a film (.mkv) is of JPEGs"), std::string::npos) << png.err;
  const Finished nowhere = nodal({"raymap", "pull", "--out", path("no/such/folder/film.mkv")});
  EXPECT_NE(nowhere.code, 0);
  EXPECT_NE(nowhere.err.find("there is no such folder as"), std::string::npos) << nowhere.err;
  if (!std::filesystem::exists("/dev/full")) return;
  std::filesystem::create_symlink("/dev/full", path("full.mkv"));
  const Finished full = nodal({"raymap", "pull", "-n", "2", "--out", path("full.mkv")});
  EXPECT_NE(full.code, 0);
  EXPECT_NE(full.err.find("full.mkv: No space left on device"), std::string::npos) << full.err;
}

}  // namespace
}  // namespace nodal::command_line
