// What a reader that an attacker has taken over may do: read the command's inputs, write beside its outputs, nothing
// else.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

class Confinement : public testing::Test {
 protected:
  Confinement() {
    for (const char* folder : {"in", "out", "elsewhere"}) fs::create_directories(folder_ / folder);
    test::write_bytes(folder_ / "in/a.png", test::png_of(test::smooth_rgb(64, 32), 64, 32, 3));
    std::ofstream(folder_ / "elsewhere/secret") << "secret\n";
  }

  /// Runs nodal with the reader of an attacker in it.
  test::Finished attacked(std::vector<std::string> words, std::map<std::string, std::string> environment = {}) const {
    words.insert(words.begin(), NODAL_BIN_DIR "/nodal");
    environment.insert({{"LD_PRELOAD", NODAL_BIN_DIR "/libcompromised_reader.so"},
                        {"TEST_SECRET", (folder_ / "elsewhere/secret").string()},
                        {"TEST_INPUT", (folder_ / "in/a.png").string()},
                        {"TEST_ELSEWHERE", (folder_ / "elsewhere/written").string()},
                        {"TEST_BESIDE", (folder_ / "out/beside").string()}});
    return test::Process(words, environment).wait();
  }
  static std::string answer(const test::Finished& run, const std::string& attempt) {
    const std::string line = "attempt " + attempt + ": ";
    const std::size_t at = run.err.find(line);
    if (at == std::string::npos) return "not tried";
    return run.err.substr(at + line.size(), run.err.find('\n', at) - at - line.size());
  }
  test::Finished convert(const std::map<std::string, std::string>& environment = {}) const {
    return attacked({"-v", "convert", (folder_ / "in/a.png").string(), "--from", "equirectangular", "--layout", "cube",
                     "-o", (folder_ / "out/b.png").string()},
                    environment);
  }

  test::TemporaryFolder folder_;
};

#ifndef __SANITIZE_ADDRESS__
TEST_F(Confinement, AReaderThatIsTakenOver_ReadsTheInputAndWritesBesideTheOutput_AndNothingElse) {
  const test::Finished run = convert();
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_TRUE(fs::exists(folder_ / "out/b.png")) << "the command itself works";
  if (run.err.find("seccomp yes") == std::string::npos) GTEST_SKIP() << "this kernel has no seccomp: " << run.err;
  for (const char* attempt : {"internet", "internet 6", "unix socket", "netlink", "program", "trace the parent"}) {
    EXPECT_EQ(answer(run, attempt), "denied") << attempt << "\n" << run.err;
  }
  if (run.err.find("Landlock version") == std::string::npos) GTEST_SKIP() << "this kernel has no Landlock: " << run.err;
  for (const char* attempt : {"secret", "passwords", "overwrite the input", "write elsewhere"}) {
    EXPECT_EQ(answer(run, attempt), "denied") << attempt << "\n" << run.err;
  }
  for (const char* attempt : {"read the input", "write beside the output"}) {
    EXPECT_EQ(answer(run, attempt), "allowed") << attempt << "\n" << run.err;
  }
}

TEST_F(Confinement, Unconfined_TheSameReaderReachesAll_SoTheTestTriesWhatItSays) {
  const test::Finished run = convert({{"NODAL_CONFINE", "off"}});
  EXPECT_EQ(run.code, 0) << run.err;
  for (const char* attempt : {"secret", "passwords", "write elsewhere", "unix socket", "program", "read the input"}) {
    EXPECT_EQ(answer(run, attempt), "allowed") << attempt << "\n" << run.err;
  }
}

TEST_F(Confinement, APictureThatAProjectNamesElsewhere_IsDeniedByTheKernelToo) {
  std::ofstream(folder_ / "in/rig.pto") << "p f2 w3000 h1500 v360\n"
                                           "i w64 h32 f0 v60 r0 p0 y0 n\"a.png\"\n"
                                           "i w64 h32 f0 v60 r0 p0 y40 n\"a.png\"\n";
  const test::Finished run =
      attacked({"-v", "stitch", (folder_ / "in/rig.pto").string(), "-o", (folder_ / "out/s.jpg").string()});
  if (run.err.find("Landlock version") == std::string::npos) GTEST_SKIP() << "this kernel has no Landlock: " << run.err;
  EXPECT_EQ(answer(run, "read the input"), "allowed") << run.err;
  EXPECT_EQ(answer(run, "secret"), "denied") << run.err;
}
#endif

}  // namespace
}  // namespace nodal::command_line
