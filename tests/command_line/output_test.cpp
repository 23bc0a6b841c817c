// The messages of `nodal` when its answer cannot be written, when a signal ends it, and when the rig hangs.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

const std::string kNodal = NODAL_BIN_DIR "/nodal ";

class Output : public RigTest {
 protected:
  std::unique_ptr<Process> start_shell(const std::string& script) const {
    return std::make_unique<Process>(Words{"sh", "-c", script}, environment_);
  }
  Finished shell(const std::string& script) const { return start_shell(script)->wait(); }

  /// A pull that has delivered raymaps and continues.
  std::unique_ptr<Process> pull_under_way(Words words) const {
    words.insert(words.begin(), {"--json", "raymap", "pull", "--out", path("live.jpg")});
    std::unique_ptr<Process> pull = start(words);
    EXPECT_TRUE(wait_until([&] { return pull->said().find("\"raymap\"") != std::string::npos; }));
    return pull;
  }

  std::size_t files_in(const std::string& folder) const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(path(folder)), fs::directory_iterator()));
  }
};

std::size_t times(const std::string& text, const std::string& words) {
  std::size_t count = 0;
  for (std::size_t at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++count;
  return count;
}

// --- standard output -------------------------------------------------------------------------------------

TEST_F(Output, FullDevice_IsSaidOnceAndIsAnExitCodeOfItsOwn) {
  start_nodald();
  bring_up();
  for (const std::string command : {"--help", "--version", "raymap pull --help", "completion bash",
                                    "--json completion bash", "calibration check SIX", "--json calibration check SIX",
                                    "status", "--json status", "status --watch", "raymap pull --out -"}) {
    std::string words = command;
    if (const std::size_t at = words.find("SIX"); at != std::string::npos) words.replace(at, 3, path("six.json"));
    const Finished run = shell(kNodal + words + " > /dev/full");
    EXPECT_EQ(run.code, 9) << command << ": " << run.err;
    EXPECT_EQ(times(run.err, "standard output could not be written"), 1U) << command << ": " << run.err;
    EXPECT_EQ(times(run.err, "\n"), 1U) << command << ": " << run.err;
  }
}

TEST_F(Output, ErrorThatCannotBeWrittenAsJson_KeepsItsExitCode) {
  const Finished run = shell(kNodal + "--json status > /dev/full");  // no rig
  EXPECT_EQ(run.code, 3) << run.err;
}

TEST_F(Output, ReaderThatGoesAway_EndsItQuietlyAsSigpipeDoes) {
  start_nodald();
  bring_up();
  for (const std::string command : {"status --watch --interval 5ms", "--json status --watch --interval 5ms",
                                    "raymap pull --continuous --out -", "raymap pull -n 100000 --out -"}) {
    const Finished run =
        shell("{ " + kNodal + command + "; echo $? > " + path("code") + "; } | head -c 10 > /dev/null");
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_EQ(read("code"), "141\n") << command;
    EXPECT_EQ(run.err, "") << command;
  }
}

TEST_F(Output, ClosedStandardOutput_IsALostAnswerAndNothingReachesTheRig) {
  start_nodald();
  const Finished run = shell(kNodal + "status >&-");
  EXPECT_EQ(run.code, 9) << run.err;
  EXPECT_NE(run.err.find("standard output could not be written (it is closed)"), std::string::npos) << run.err;
  const Finished watch = shell(kNodal + "status --watch --count 3 --interval 5ms <&- >&-");
  EXPECT_EQ(watch.code, 9) << watch.err;
  EXPECT_EQ(shell(kNodal + "status <&- 2>&-").code, 0);
  EXPECT_EQ(nodald().complained().find("protocol ("), std::string::npos) << nodald().complained();
}

TEST_F(Output, NodaldWithoutStandardDescriptors_PutsNothingElseInTheirPlace) {
  const auto rig =
      start_shell("exec " NODAL_BIN_DIR "/nodald --config " + path("rig.toml") + " --blend-threads 1 <&- >&- 2>&-");
  ASSERT_TRUE(wait_until([this] { return nodal({"status"}).code == 0; }));
  for (const std::string descriptor : {"0", "1", "2"}) {
    EXPECT_EQ(fs::read_symlink("/proc/" + std::to_string(rig->pid()) + "/fd/" + descriptor), "/dev/null") << descriptor;
  }
  rig->signal(SIGTERM);
  EXPECT_EQ(rig->wait().code, 0);
}

// --- files -----------------------------------------------------------------------------------------------

TEST_F(Output, FileOverItsSizeLimit_IsAnErrorThatNamesItAndLeavesNothing) {
  fs::create_directory(path("out"));
  const Finished run = shell("ulimit -f 1; exec " + kNodal + "pattern -o " + path("out/pattern.pdf"));
  EXPECT_EQ(run.code, 6) << run.err;
  EXPECT_NE(run.err.find("out/pattern.pdf"), std::string::npos) << run.err;
  EXPECT_EQ(files_in("out"), 0U);
}

TEST_F(Output, FileThatIsThere_IsRefusedAndKeptUntilItMayBeReplaced) {
  start_nodald();
  bring_up();
  for (const std::string& command :
       {"pattern -o " + path("there.pdf"), "raymap pull -o " + path("there.jpg"),
        "raymap pull -n 3 -o " + path("there.mkv"), "calibration show -o " + path("there.json")}) {
    const std::string file = command.substr(command.rfind(' ') + 1);
    std::ofstream(file) << "precious";
    const Finished refused = shell("NODAL_OVERWRITE=0 " + kNodal + command);
    EXPECT_EQ(refused.code, 6) << command << ": " << refused.err;
    EXPECT_NE(refused.err.find(file + ": is there already"), std::string::npos) << refused.err;
    EXPECT_EQ(fs::file_size(file), 8U) << command;
    const Finished replaced = shell("NODAL_OVERWRITE=0 " + kNodal + command + " --overwrite");
    EXPECT_EQ(replaced.code, 0) << command << ": " << replaced.err;
    EXPECT_GT(fs::file_size(file), 100U) << command;
  }
}

TEST_F(Output, Umask_HoldsForFilesThatAreWritten) {
  ASSERT_EQ(shell("umask 077; exec " + kNodal + "pattern -o " + path("private.pdf")).code, 0);
  ASSERT_EQ(shell("umask 022; exec " + kNodal + "pattern -o " + path("public.pdf")).code, 0);
  struct stat info {};
  ASSERT_EQ(::stat(path("private.pdf").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600U);
  ASSERT_EQ(::stat(path("public.pdf").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0644U);
}

// --- signals ---------------------------------------------------------------------------------------------

TEST_F(Output, SignalBeforeThePullIsDone_SaysWhatCameAndIsNoSuccess) {
  start_nodald();
  bring_up();
  for (const auto& [number, code] : {std::pair(SIGINT, 130), std::pair(SIGTERM, 143)}) {
    const auto pull = pull_under_way({"-n", "1000000"});
    pull->signal(number);
    const Finished run = pull->wait();
    EXPECT_EQ(run.code, code) << run.err;
    const std::size_t came = times(run.out, "{\"raymap\"");
    EXPECT_NE(run.out.find("{\"summary\":{\"pulled\":" + std::to_string(came)), std::string::npos) << run.out;
    EXPECT_NE(run.err.find("after " + std::to_string(came) + " raymap"), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("1000000 raymaps were asked for"), std::string::npos) << run.err;
  }
}

TEST_F(Output, CtrlCOfWhatGoesOnForEver_IsItsUsualEnd) {
  start_nodald();
  bring_up();
  const auto pull = pull_under_way({"--continuous"});
  pull->signal(SIGINT);
  EXPECT_EQ(pull->wait().code, 0);
  const auto watch = start({"status", "--watch", "--interval", "5ms"});
  ASSERT_TRUE(wait_until([&] { return !watch->said().empty(); }));
  watch->signal(SIGINT);
  EXPECT_EQ(watch->wait().code, 0);
}

TEST_F(Output, CtrlCOfWhatWouldEndByItself_IsNoSuccess) {
  start_nodald();
  bring_up();
  const auto watch = start({"status", "--watch", "--interval", "5ms", "--count", "1000000"});
  ASSERT_TRUE(wait_until([&] { return !watch->said().empty(); }));
  watch->signal(SIGINT);
  EXPECT_EQ(watch->wait().code, 130);
  const auto span = pull_under_way({"--for", "1000min"});
  span->signal(SIGINT);
  EXPECT_EQ(span->wait().code, 130);
  const auto sync = start({"sync", "report", "-n", "1000000"});
  ASSERT_TRUE(wait_until([&] { return sync->complained().find("set [") != std::string::npos; }));
  sync->signal(SIGINT);
  const Finished report = sync->wait();
  EXPECT_EQ(report.code, 130);
  EXPECT_NE(report.out.find("spread of mid-exposures"), std::string::npos) << report.out;
}

// --- a rig that hangs ------------------------------------------------------------------------------------

TEST_F(Output, RigThatHangs_EndsEveryWaitByTimeout) {
  start_nodald();
  bring_up();
  std::vector<std::unique_ptr<Process>> waiting;
  waiting.push_back(pull_under_way({"--timeout", "3s", "--continuous"}));
  waiting.push_back(start({"--timeout", "3s", "status", "--watch", "--interval", "60min"}));
  ASSERT_TRUE(wait_until([&] { return !waiting.back()->said().empty(); }));
  waiting.push_back(start({"--timeout", "3s", "sync", "report", "-n", "1000000"}));
  ASSERT_TRUE(wait_until([&] { return waiting.back()->complained().find("set [") != std::string::npos; }));
  nodald().signal(SIGSTOP);
  for (const auto& process : waiting) {
    const Finished run = process->wait();
    EXPECT_EQ(run.code, 3) << run.err;
    EXPECT_NE(run.err.find("timeout (303)"), std::string::npos) << run.err;
  }
  nodald().signal(SIGCONT);
}

TEST_F(Output, RigThatIsQuietAndAlive_IsWaitedForLongerThanTheTimeout) {
  start_nodald();
  const Finished watch = nodal({"--timeout", "1s", "--json", "status", "--watch", "--interval", "3s", "--count", "2"});
  EXPECT_EQ(watch.code, 0) << watch.err;
  EXPECT_EQ(times(watch.out, "\n"), 2U);
}

}  // namespace
}  // namespace nodal::command_line
