// What takes of the real nodald say, and how `nodal` passes it on: rates, copies that are not complete, what was done
// before an error.
#include <filesystem>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

class TakeTells : public RigTest {
 protected:
  /// Records a take until it has so many sets.
  void record(std::uint64_t sets) {
    ASSERT_EQ(nodal({"take", "start"}).code, 0);
    ASSERT_TRUE(
        wait_until([&] { return nodal_json({"status"}).at(0)["recording"]["sets"].get<std::uint64_t>() >= sets; },
                   std::chrono::seconds(60)));
    ASSERT_EQ(nodal({"take", "stop"}).code, 0);
  }
  /// Frames of a film, as FFmpeg counts them: those that are in it, and those of its copy in another format.
  std::pair<std::string, std::string> counted(const std::string& film) {
    const std::string copy = path("copy.mp4");
    fs::remove(copy);
    const Finished made = Process({"ffmpeg", "-v", "error", "-i", film, "-c:v", "mpeg4", copy}).wait();
    EXPECT_EQ(made.code, 0) << made.err;
    return {probed(film, "nb_read_packets", true), probed(copy, "nb_read_packets", true)};
  }
  std::string probed(const std::string& film, const std::string& entry, bool count = false) {
    Words words{"ffprobe", "-v", "error", "-select_streams", "v:0"};
    if (count) words.push_back("-count_packets");
    words.insert(words.end(), {"-show_entries", "stream=" + entry, "-of", "default=nk=1:nw=1", film});
    return Process(words).wait().out;
  }
};

TEST_F(TakeTells, AtAnotherRateThanRigToml_EveryFilmAndDocumentHasIt) {
  if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  start_rig_with_takes();
  ASSERT_EQ(nodal({"genlock", "start", "--rate", "50"}).code, 0);
  ASSERT_TRUE(wait_until([&] { return nodal_json({"status"}).at(0)["genlock"]["state"] == "locked"; },
                         std::chrono::seconds(60)));
  record(60);
  const std::string take = path("takes/000001");
  EXPECT_EQ(Json::parse(read("takes/000001/take.json"))["rate"], Json({50, 1}));
  EXPECT_EQ(Json::parse(read("takes/000001/manifest"))["rates"].at(0)["rate"], Json({50, 1}));
  EXPECT_EQ(nodal_json({"take", "show", take}).at(0)["rates"].at(0)["rate"], Json({50, 1}));
  EXPECT_EQ(nodal_json({"take", "list"}).at(0)["takes"].at(0)["rate"], Json({50, 1}));
  ASSERT_EQ(nodal({"take", "export", take, "--to", path("films")}).code, 0);
  ASSERT_EQ(nodal({"render", take, "-o", path("rendered.mkv")}).code, 0);
  ASSERT_EQ(nodal({"raymap", "pull", "-n", "20", "--lossless", "--out", path("pulled.mkv")}).code, 0);
  for (const std::string& film : {take + "/cam0-0000.mkv", take + "/raymap-0000.mkv", path("films/cam0.mkv"),
                                  path("films/raymaps.mkv"), path("rendered.mkv"), path("pulled.mkv")}) {
    const auto [in_film, in_copy] = counted(film);
    EXPECT_EQ(probed(film, "avg_frame_rate"), "50/1\n") << film;
    EXPECT_EQ(in_film, in_copy) << film;
    const std::string date =
        Process({"ffprobe", "-v", "error", "-show_entries", "format_tags=creation_time", film}).wait().out;
    EXPECT_NE(date.find("creation_time=20"), std::string::npos) << film << date;
  }
}

TEST_F(TakeTells, ACopyThatIsNotComplete_IsCalledSoByEveryCommand) {
  start_rig_with_takes();
  record(10);
  ASSERT_EQ(nodal({"offload", "1", "--to", path("off")}).code, 0);
  const std::string copy = path("off/000001");
  fs::rename(copy + "/manifest", copy + "/manifest.part");
  fs::rename(copy + "/cam1-0000.mkv", copy + "/cam1-0000.mkv.part");
  for (const Words& words : {Words{"take", "verify", copy}, Words{"take", "show", copy},
                             Words{"take", "export", copy, "--to", path("films")}, Words{"render", copy}}) {
    const Finished refused = nodal(words);
    EXPECT_NE(refused.code, 0);
    EXPECT_NE(refused.err.find("the copy is not complete; the same `nodal offload` goes on with it"), std::string::npos)
        << refused.err;
  }
}

TEST_F(TakeTells, OneTakeCannotBeDeleted_JsonHasItAndTheOthersToo) {
  start_rig_with_takes();
  record(5);
  record(5);
  ASSERT_EQ(nodal({"take", "protect", "1"}).code, 0);
  const Finished moved = nodal({"--json", "offload", "--new", "--delete", "--to", path("off")});
  EXPECT_NE(moved.code, 0);
  const Json document = Json::parse(moved.out.substr(0, moved.out.find('\n')));
  ASSERT_EQ(document["takes"].size(), 2U) << moved.out;
  EXPECT_EQ(document["takes"][0]["deleted"], false);
  EXPECT_EQ(document["takes"][1]["deleted"], true);
  ASSERT_EQ(document["failed"].size(), 1U);
  EXPECT_EQ(document["failed"][0]["take"], 1);
}

TEST_F(TakeTells, ExportedToAFolderWithFilms_IsRefusedAndReplacesThemWithOverwrite) {
  const Refusing overwriting;
  start_rig_with_takes();
  record(5);
  const Words exports{"take", "export", path("takes/000001"), "--to", path("out")};
  ASSERT_EQ(nodal(exports).code, 0);
  const std::string film = read("out/cam0.mkv"), table = read("out/frames.csv");
  for (const char* name : {"out/cam0.mkv", "out/frames.csv", "out/cam9.mkv"}) write(name, "of another take");
  const Finished refused = nodal(exports);
  EXPECT_NE(refused.code, 0);
  EXPECT_NE(refused.err.find("--overwrite"), std::string::npos) << refused.err;
  EXPECT_EQ(read("out/cam0.mkv"), "of another take");
  Words replaces = exports;
  replaces.push_back("--overwrite");
  const Finished replaced = nodal(replaces);
  EXPECT_EQ(replaced.code, 0) << replaced.err;
  EXPECT_EQ(read("out/cam0.mkv").size(), film.size());
  EXPECT_EQ(read("out/frames.csv"), table);
  EXPECT_EQ(read("out/cam9.mkv"), "of another take");
  EXPECT_NE(replaced.err.find("cam9.mkv was there before, and is not of this take"), std::string::npos) << replaced.err;
}

}  // namespace
}  // namespace nodal::command_line
