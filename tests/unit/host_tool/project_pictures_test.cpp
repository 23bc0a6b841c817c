// A project names pictures in its own folder only, unless the user allows others.
#include "host_tool/input/project_pictures.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "host_tool/input/rig_pictures.h"
#include "run_nodal.h"
#include "tests/support/pictures.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

class ProjectPictures : public testing::Test {
 protected:
  ProjectPictures() {
    fs::create_directories(folder_ / "project/inner");
    for (const char* name : {"secret.png", "project/a.png", "project/inner/b.png"})
      std::ofstream(folder_ / name) << "x";
    fs::create_symlink(folder_ / "secret.png", folder_ / "project/link.png");
    fs::create_directory_symlink(folder_.path(), folder_ / "project/up");
  }
  Result<ProjectPicture> named(const std::string& image, PicturePlaces places = PicturePlaces::kBesideProject) const {
    return project_picture((folder_ / "project/rig.pto").string(), image, places);
  }
  test::TemporaryFolder folder_;
};

TEST_F(ProjectPictures, InTheFolderOrBelowIt_AreFoundAlsoByTheirWholePath) {
  for (const std::string& image : {std::string("a.png"), std::string("./inner/b.png"), std::string("inner/../a.png"),
                                   (folder_ / "project/a.png").string(), std::string("missing.png")}) {
    const auto file = named(image);
    EXPECT_TRUE(file) << image << ": " << (file ? "" : file.error().message);
  }
}

TEST_F(ProjectPictures, OutsideTheFolder_AreRefusedWithTheNameAndTheOption) {
  for (const std::string& image :
       {std::string("../secret.png"), (folder_ / "secret.png").string(), std::string("inner/../../secret.png"),
        std::string("link.png"), std::string("up/secret.png"), std::string("/etc/passwd")}) {
    const auto file = named(image);
    ASSERT_FALSE(file) << image;
    EXPECT_EQ(file.error().code, Errc::kBadValue);
    EXPECT_NE(file.error().message.find(image), std::string::npos) << file.error().message;
    EXPECT_NE(file.error().message.find("--pictures-anywhere"), std::string::npos) << file.error().message;
    EXPECT_TRUE(named(image, PicturePlaces::kAnywhere)) << image;
  }
}

TEST_F(ProjectPictures, OfAnotherMachine_AreFoundBesideTheProject) {
  struct {
    std::string image, file;
  } const kNames[] = {{"C:\\Users\\and\\a.png", "a.png"},
                      {"/elsewhere/pictures/a.png", "a.png"},
                      {"../../elsewhere/A.PNG", "a.png"},
                      {"D:/rig/inner/b.png", "inner/b.png"},
                      {"inner\\b.png", "inner/b.png"}};
  for (const auto& [image, file] : kNames) {
    const auto found = named(image);
    ASSERT_TRUE(found) << image;
    EXPECT_EQ(found->file, (folder_ / "project" / file).string()) << image;
    EXPECT_TRUE(found->moved);
  }
  EXPECT_FALSE(named("a.png")->moved);
  // Nothing outside is reached by such a name, and nothing that is not there is invented.
  EXPECT_FALSE(named("C:\\up\\secret.png")->moved);
  EXPECT_FALSE(named("/nowhere/c.png"));
  EXPECT_EQ(named("c.png")->file, (folder_ / "project/c.png").string());
}

TEST_F(ProjectPictures, StitchAProjectOfAnotherMachine_SaysWhereItsPicturesAre) {
  const std::string project = (folder_ / "project/rig.pto").string();
  std::ofstream(project) << "i w640 h480 f0 v60 r0 p0 y0 n\"C:\\rig\\b.png\"\n"
                            "i w640 h480 f0 v60 r0 p0 y40 n\"C:\\rig\\a.png\"\n";
  for (const int n : {0, 1}) {
    const std::vector<std::uint8_t> grey(640 * 480, static_cast<std::uint8_t>(90 + n));
    test::write_bytes(folder_ / (n == 0 ? "project/a.png" : "project/b.png"), test::png_of(grey, 640, 480, 1));
  }
  const auto input = read_rig_pictures({}, {project});
  ASSERT_TRUE(input) << input.error().text();
  EXPECT_EQ(input->files(), (std::vector<std::vector<std::string>>{
                                {(folder_ / "project/b.png").string(), (folder_ / "project/a.png").string()}}));
  ASSERT_EQ(input->notes.size(), 1u) << input->notes.back();
  EXPECT_NE(input->notes[0].find("2 of 2 pictures"), std::string::npos) << input->notes[0];
  EXPECT_NE(input->notes[0].find("b.png"), std::string::npos) << input->notes[0];
  const Outcome imported(
      {"import", project, "-o", (folder_ / "c.json").string(), "--rig-toml", (folder_ / "rig.toml").string()});
  EXPECT_EQ(imported.code, ExitCode::kOk) << imported.err;
  EXPECT_NE(imported.err.find("2 of 2 pictures are not where the project says"), std::string::npos) << imported.err;
}

TEST_F(ProjectPictures, EveryCommandWithACalibration_TakesAProject) {
  const std::string project = (folder_ / "project/rig.pto").string();
  std::ofstream(project) << "i w640 h480 f0 v60 r0 p0 y0 n\"a.png\"\n"
                            "i w640 h480 f0 v60 r0 p0 y40 n\"inner/b.png\"\n";
  const std::string out = (folder_ / "out").string();
  for (const std::vector<std::string>& words : {std::vector<std::string>{"calibration", "check", project},
                                                {"calibration", "diff", project, project},
                                                {"export", project, "--format", "pts", "-o", out}}) {
    const Outcome outcome(words);
    EXPECT_EQ(outcome.code, ExitCode::kOk) << words[0] << ": " << outcome.err;
  }
  // The others get as far as their pictures, which these are not.
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"register", project},
        {"drift", project},
        {"stitch", project},
        {"calibrate", "light", project, (folder_ / "project/a.png").string()}}) {
    const Outcome outcome(words);
    EXPECT_EQ(outcome.code, ExitCode::kBadInput);
    EXPECT_NE(outcome.err.find("picture"), std::string::npos) << words[0] << ": " << outcome.err;
  }
}

TEST_F(ProjectPictures, AFolderWithTheSameBeginning_IsAnother) {
  fs::create_directories(folder_ / "project2");
  std::ofstream(folder_ / "project2/z.png") << "x";
  EXPECT_FALSE(named("../project2/z.png"));
}

TEST_F(ProjectPictures, ANameWithControlCharacters_IsShownWithoutThem) {
  const auto file = named("../x\x1b[2J\n.png");
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().message.find('\x1b'), std::string::npos);
  EXPECT_EQ(file.error().message.find('\n'), std::string::npos);
}

TEST_F(ProjectPictures, StitchAndImport_DoNotReadWhatAProjectNamesElsewhere) {
  const std::string project = (folder_ / "project/rig.pto").string();
  std::ofstream(project) << "p f2 w3000 h1500 v360\n"
                            "i w640 h480 f0 v60 r0 p0 y0 n\"../secret.png\"\n"
                            "i w640 h480 f0 v60 r0 p0 y40 n\"a.png\"\n";
  const Outcome stitched({"stitch", project, "-o", (folder_ / "s.jpg").string()});
  EXPECT_EQ(stitched.code, ExitCode::kBadInput);
  EXPECT_NE(stitched.err.find("outside the project's folder"), std::string::npos) << stitched.err;
  const Outcome imported(
      {"import", project, "-o", (folder_ / "c.json").string(), "--rig-toml", (folder_ / "rig.toml").string()});
  EXPECT_EQ(imported.code, ExitCode::kBadInput);
  EXPECT_FALSE(fs::exists(folder_ / "rig.toml"));
  const Outcome warned({"import", project, "-o", (folder_ / "c.json").string()});
  EXPECT_EQ(warned.code, ExitCode::kOk) << warned.err;
  EXPECT_NE(warned.err.find("outside the project's folder"), std::string::npos) << warned.err;
  const Outcome allowed({"stitch", project, "-o", (folder_ / "s.jpg").string(), "--pictures-anywhere"});
  EXPECT_EQ(allowed.err.find("outside the project's folder"), std::string::npos) << allowed.err;
}

}  // namespace
}  // namespace nodal::host
