// The page for scripts: its Python runs, and its table has what commands print.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "rig_process.h"
#include "tests/support/pictures.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {
namespace {

const char* const kPage = NODAL_SOURCE_DIR "/host_tool/SCRIPTS.md";

/// The indented lines under a heading.
std::string code_under(const std::string& heading) {
  std::ifstream page(kPage);
  std::string code;
  bool here = false;
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("## ")) here = line == "## " + heading;
    if (here && line.starts_with("    ")) code += line.substr(4) + "\n";
    if (here && line.empty()) code += "\n";
  }
  return code;
}

/// The row of the table that names a command first.
std::string row_of(const std::string& command) {
  std::ifstream page(kPage);
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("| `" + command + "`")) return line;
  }
  return "";
}

class Scripts : public RigTest {
 protected:
  void expect_in_table(const std::string& command, const Words& words, std::size_t at_least) {
    SCOPED_TRACE(command);
    const std::string row = row_of(command);
    ASSERT_FALSE(row.empty());
    const std::vector<Json> documents = nodal_json(words);
    ASSERT_FALSE(documents.empty());
    EXPECT_GE(documents.at(0).size(), at_least);
    for (const auto& [name, value] : documents.at(0).items()) {
      EXPECT_NE(row.find(name), std::string::npos) << "'" << name << "' is not in the row\n" << row;
    }
  }
};

TEST_F(Scripts, PythonOfThePage_Runs) {
  if (Process({"sh", "-c", "command -v python3"}).wait().code != 0) GTEST_SKIP() << "python3 is not installed";
  start_rig_with_takes();
  Calibration three = test::six_fisheyes(320, 190);
  three.heads.resize(3);
  const test::RenderedRig rig =
      test::render_rig(three, hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1.0, 5, 2});
  for (std::size_t h = 0; h < 3; ++h) {
    test::write_bytes(path(std::string(1, static_cast<char>('a' + h)) + ".jpg"),
                      test::png_of(rig.bytes[h], 320, 320, 3));
  }
  write("page.py", code_under("Twenty lines of Python"));
  environment_["PATH"] = NODAL_BIN_DIR ":" + std::string(std::getenv("PATH"));
  const Finished run = Process({"sh", "-c", "cd '" + path(".") + "' && exec python3 page.py"}, environment_).wait();
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.out.find("sphere.jpg "), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("take 1 of "), std::string::npos) << run.out << "the rig ran, and so a take was made";
}

TEST_F(Scripts, MembersOfDocuments_AreInTheTable) {
  start_rig_with_takes();
  expect_in_table("status", {"status"}, 20);
  expect_in_table("heads", {"heads"}, 1);
  expect_in_table("head set", {"head", "set", "cam0", "--gain", "1dB"}, 1);
  expect_in_table("hosts", {"hosts"}, 1);
  expect_in_table("exposure show", {"exposure", "show"}, 10);
  expect_in_table("genlock show", {"genlock", "show"}, 8);
  expect_in_table("calibration list", {"calibration", "list"}, 1);
  expect_in_table("calibration check", {"calibration", "check", path("six.json")}, 5);
  expect_in_table("calibration diff", {"calibration", "diff", path("six.json"), path("truth.json")}, 3);
  expect_in_table("audit", {"audit"}, 5);
  expect_in_table("raymap pull", {"raymap", "pull", "-o", path("r.jpg")}, 1);
  expect_in_table("convert", {"convert", path("r.jpg"), "--layout", "cube", "-o", path("c.jpg")}, 5);
  expect_in_table("take start", {"take", "still"}, 1);
  expect_in_table("take list", {"take", "list"}, 1);
  expect_in_table("take show", {"take", "show", "1"}, 10);
  expect_in_table("offload", {"offload", "--new", "--to", path("copies")}, 2);
  expect_in_table("take verify", {"take", "verify", path("copies/000001")}, 5);
  expect_in_table("take export", {"take", "export", path("copies/000001"), "--to", path("films")}, 4);
  expect_in_table("pattern", {"pattern", "-o", path("p.pdf")}, 4);
  expect_in_table("export", {"export", path("six.json"), "--format", "pto", "-o", path("e.pto")}, 3);
}

}  // namespace
}  // namespace nodal::command_line
