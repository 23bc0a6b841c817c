// Folders of pictures: what they are taken for, by every command.
#include "stitch_command.h"

namespace nodal::command_line {
namespace {

TEST_F(StitchCommand, FoldersWithoutACalibration_AreCalibratedByTheMiddleSetAndStitchedFrameByFrame) {
  write_pictures("set");
  Words folders;
  for (std::size_t h = 0; h < town().truth.heads.size(); ++h) {
    std::filesystem::create_directories(path("film/" + name_of(h)));
    for (const char* frame : {"0001.png", "0002.png", "0003.png"}) {
      std::filesystem::copy_file(path("set/" + name_of(h) + ".png"), path("film/" + name_of(h) + "/" + frame));
    }
    folders.push_back(path("film/" + name_of(h)));
  }
  Words one_name = folders;
  one_name.insert(one_name.end(), {"-o", path("f.jpg")});
  expect_refused(one_name, "put %04d into it");
  EXPECT_FALSE(std::filesystem::exists(path("f.rig.json"))) << "refused before it is calibrated";
  Words words{"stitch"};
  words.insert(words.end(), folders.begin(), folders.end());
  words.insert(words.end(), {"--width", "256", "-o", path("f-%02d.png")});
  const Json answer = nodal_json(words).at(0);
  EXPECT_EQ(answer["raymaps"], 3);
  EXPECT_EQ(answer["calibration_file"], path("f.rig.json"));
  EXPECT_NE(answer["notes"].dump().find("set 2 of 3"), std::string::npos) << answer;
  // The heads are called after their folders, so that the calibration serves for the folders again.
  Words again{"stitch", path("f.rig.json")};
  again.insert(again.end(), folders.begin(), folders.end());
  again.insert(again.end(), {"--width", "256", "-o", path("g-%02d.png")});
  const Finished run = nodal(again);
  ASSERT_EQ(run.code, 0) << run.err;
  for (const char* file : {"-00.png", "-01.png", "-02.png"}) {
    EXPECT_EQ(read("f" + std::string(file)), read("g" + std::string(file))) << file;
  }
  // Stitch and register take the folders for the same, and say so.
  const std::string taken = "6 folders: each has the pictures of one head, 3 in each, sorted by name";
  EXPECT_NE(answer["notes"].dump().find(taken), std::string::npos) << answer["notes"];
  EXPECT_NE(run.err.find(taken), std::string::npos) << run.err;
  Words alone{"register"}, calibrated{"register", path("f.rig.json")};
  for (Words* command : {&alone, &calibrated}) {
    command->insert(command->end(), folders.begin(), folders.end());
    command->insert(command->end(), {"-o", path("r.json")});
    const Finished registered = nodal(*command);
    EXPECT_EQ(registered.code, 0) << registered.err;
    EXPECT_NE(registered.err.find(taken), std::string::npos) << registered.err;
  }
  write_pictures("later");
  const Finished sets = nodal({"register", path("rig.json"), path("set"), path("later"), "-o", path("r.json")});
  EXPECT_NE(sets.err.find("2 folders: each has one picture of each of the 6 heads"), std::string::npos) << sets.err;
  std::filesystem::remove(path("film/" + name_of(1) + "/0003.png"));
  Words uneven = folders;
  uneven.insert(uneven.end(), {"-o", path("f-%d.png")});
  expect_refused(uneven, name_of(1));
}

}  // namespace
}  // namespace nodal::command_line
