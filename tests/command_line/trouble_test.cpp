// Failures: each has its exit code and one clear sentence, and loses no data.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>

#include <filesystem>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;
using Trouble = RigTest;

TEST_F(Trouble, HeadNobodyKnows_IsADeviceErrorThatListsTheHeads) {
  start_nodald();
  const Finished set = nodal({"head", "set", "cam9", "--gain", "1dB"});
  EXPECT_EQ(set.code, 5);
  EXPECT_NE(set.err.find("'cam9'"), std::string::npos) << set.err;
  EXPECT_NE(set.err.find("cam0, cam1"), std::string::npos) << set.err;
}

TEST_F(Trouble, ExposureNoHeadCanDo_IsRefusedAndNamesTheHead) {
  start_nodald();
  const Finished set = nodal({"head", "set", "cam2", "--exposure", "20min"});
  EXPECT_EQ(set.code, 4) << set.err;
  EXPECT_NE(set.err.find("cam2"), std::string::npos) << set.err;
}

TEST_F(Trouble, ReflectionForARotation_IsRefusedHereAndByTheRigAndTheOldOneStays) {
  start_nodald();
  bring_up();
  Calibration mirrored = six_heads("mirrored");
  for (std::size_t i = 0; i < 3; ++i) mirrored.heads[3].R_head_rig[i] *= -1;
  write("mirrored.json", to_json(mirrored));
  const Finished here = nodal({"calibration", "upload", path("mirrored.json")});
  EXPECT_EQ(here.code, 4);
  EXPECT_NE(here.err.find("not-a-rotation"), std::string::npos) << here.err;
  EXPECT_NE(here.err.find("cam3"), std::string::npos) << here.err;
  const Finished rig = nodal({"--json", "calibration", "upload", "--unchecked", path("mirrored.json")});
  EXPECT_EQ(rig.code, 4) << rig.err;
  EXPECT_EQ(Json::parse(rig.out)["error"]["name"], "not-a-rotation");
  EXPECT_EQ(nodal_json({"status"}).at(0)["calibration_name"], "six");
}

TEST_F(Trouble, CalibrationOfOtherHeads_IsRefusedByTheRigAndTheOldOneStays) {
  start_nodald();
  bring_up();
  Calibration five = six_heads("five");
  five.heads.pop_back();
  write("five.json", to_json(five));
  const Finished upload = nodal({"--json", "calibration", "upload", path("five.json")});
  EXPECT_EQ(upload.code, 4) << upload.err;
  EXPECT_EQ(Json::parse(upload.out)["error"]["name"], "head-mismatch");
  EXPECT_NE(upload.err.find("cam5"), std::string::npos) << upload.err;
  EXPECT_EQ(nodal_json({"status"}).at(0)["calibration_name"], "six");
}

TEST_F(Trouble, FileThatIsNoCalibration_SaysWhatIsWrongWithIt) {
  write("empty.json", "");
  write("cut.json", to_json(six_heads("six")).substr(0, 500));
  write("binary.json", std::string("\0\1\2\xff", 4));
  for (const char* name : {"empty.json", "cut.json", "binary.json"}) {
    const Finished check = nodal({"calibration", "check", path(name)});
    EXPECT_EQ(check.code, 4) << check.err;
    EXPECT_NE(check.err.find(name), std::string::npos) << check.err;
  }
}

TEST_F(Trouble, CalibrationIdNobodyHas_IsNotFound) {
  start_nodald();
  bring_up();
  EXPECT_EQ(nodal({"calibration", "use", "0123456789"}).code, 6);
  EXPECT_EQ(nodal({"calibration", "show", "xyz0"}).code, 4);
  EXPECT_EQ(nodal_json({"status"}).at(0)["calibration_name"], "six");
}

TEST_F(Trouble, TwoClientsAtOnce_BothGetTheirRaymaps) {
  start_nodald();
  bring_up();
  const auto first = start({"--json", "raymap", "pull", "-n", "20", "--out", path("a-%02d.jpg")});
  const auto second = start({"--json", "raymap", "pull", "-n", "20", "--lossless", "--out", path("b-%02d.jpg")});
  EXPECT_EQ(first->wait().code, 0);
  EXPECT_EQ(second->wait().code, 0);
  EXPECT_TRUE(fs::exists(path("a-20.jpg")));
  EXPECT_TRUE(fs::exists(path("b-20.jpg")));
}

TEST_F(Trouble, NodaldKilledWhilePulling_IsALostLinkAndLeavesWholeFiles) {
  start_nodald();
  bring_up();
  const auto pull = start({"--json", "raymap", "pull", "--continuous", "--out", path("live.jpg")});
  ASSERT_TRUE(wait_until([&] { return pull->said().find("\"raymap\"") != std::string::npos; }));
  nodald().signal(SIGKILL);
  const Finished ended = pull->wait();
  EXPECT_EQ(ended.code, 3) << ended.err;
  EXPECT_NE(ended.err.find("link was lost"), std::string::npos) << ended.err;
  const std::string jpeg = read("live.jpg");
  EXPECT_EQ(jpeg.substr(0, 2), "\xFF\xD8");
  EXPECT_EQ(jpeg.substr(jpeg.size() - 2), "\xFF\xD9");
  EXPECT_EQ(nodal({"status"}).code, 3);
}

TEST_F(Trouble, NodaldStoppedDead_IsATimeoutNotAHang) {
  start_nodald();
  nodald().signal(SIGSTOP);
  const Finished status = nodal({"--timeout", "300ms", "status"});
  nodald().signal(SIGCONT);
  EXPECT_EQ(status.code, 3);
  EXPECT_NE(status.err.find("timeout"), std::string::npos) << status.err;
}

TEST_F(Trouble, NobodyReadsTheLog_TheRigGoesOnAndEndsWhenTold) {
  start_nodald();
  nodald().narrow();  // every connection logs two lines
  for (int i = 0; i < 60; ++i) {
    const Finished status = nodal({"status"});
    ASSERT_EQ(status.code, 0) << "after " << i << " hosts: " << status.err;
  }
  nodald().signal(SIGTERM);
  EXPECT_EQ(nodald().wait().code, 0);
}

TEST_F(Trouble, DeviceThatIsFull_IsAStorageError) {
  start_nodald();
  bring_up();
  const Finished pull = nodal({"raymap", "pull", "--format", "jpg", "--out", "/dev/full"});
  EXPECT_EQ(pull.code, 6);
  EXPECT_NE(pull.err.find("disk-full"), std::string::npos) << pull.err;
}

TEST_F(Trouble, DiskThatFillsUp_KeepsTheWholePicturesAndNoHalfOne) {
  start_nodald();
  bring_up();
  fs::create_directory(path("disk"));
  if (::mount("tmpfs", path("disk").c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "mounting a small disk takes root";
  }
  const Finished pull = nodal({"raymap", "pull", "-n", "100", "--out", path("disk/r-%03d.raw")});
  EXPECT_EQ(pull.code, 6);
  EXPECT_NE(pull.err.find("the disk is full"), std::string::npos) << pull.err;
  for (const fs::directory_entry& entry : fs::directory_iterator(path("disk"))) {
    const std::string name = entry.path().filename().string();
    EXPECT_TRUE(name.ends_with(".raw") || name.ends_with(".raw.json")) << name;
    if (name.ends_with(".raw")) {
      EXPECT_EQ(entry.file_size(), 256U * 128 * 3 / 2) << name;
    }
  }
  EXPECT_EQ(nodal({"status"}).code, 0);
  ::umount2(path("disk").c_str(), MNT_DETACH);
}

TEST_F(Trouble, ReaderThatGoesAway_EndsAWatch) {
  start_nodald();
  const Finished shell =
      Process({"sh", "-c", NODAL_BIN_DIR "/nodal status --watch --interval 5ms | head -n 1"}, environment_).wait();
  EXPECT_EQ(std::count(shell.out.begin(), shell.out.end(), '\n'), 1);
}

// --- ssh, played by a script that runs here -------------------------------------------------------------

TEST_F(Trouble, SshToARig_WorksAsTheSocketDoes) {
  start_nodald();
  fake_ssh("echo \"$@\" > " + path("arguments") + "\nexec BRIDGE\n");
  bring_up();
  EXPECT_EQ(read("arguments"), "-T -p 2222 somebody@rig.local nodald --bridge\n");
  EXPECT_EQ(nodal({"raymap", "pull", "-n", "3", "--lossless", "--out", path("r-%d.jpg")}).code, 0);
  EXPECT_TRUE(fs::exists(path("r-3.jpg")));
}

TEST_F(Trouble, SshThatCannotLogIn_PassesOnWhatItSaid) {
  fake_ssh("echo 'somebody@rig.local: Permission denied (publickey).' >&2\nexit 255\n");
  const Finished status = nodal({"status"});
  EXPECT_EQ(status.code, 3);
  EXPECT_NE(status.err.find("Permission denied"), std::string::npos) << status.err;
  EXPECT_NE(status.err.find("somebody@rig.local nodald --bridge"), std::string::npos) << status.err;
}

TEST_F(Trouble, SshToARigWhereNodaldDoesNotRun_SaysSo) {
  fake_ssh("exec BRIDGE\n");
  const Finished status = nodal({"status"});
  EXPECT_EQ(status.code, 3);
  EXPECT_NE(status.err.find("nodal.sock"), std::string::npos) << status.err;
}

TEST_F(Trouble, LinkThatBreaksInTheMiddleOfAnUpload_IsMadeAnewAndGoesOn) {
  start_nodald();
  // Spaces make the document long enough for several pieces; the first two links break after 150 and 300 kB. (cat
  // separates dd from the bridge, which makes its output, and with it dd's input, non-blocking.)
  write("long.json", to_json(six_heads("long")) + std::string(600'000, ' '));
  fake_ssh("n=$(cat " + path("links") +
           " 2>/dev/null || echo 0)\n"
           "echo $((n + 1)) > " +
           path("links") +
           "\n"
           "case $n in\n"
           "  0|1) dd bs=1 count=$((150000 * (n + 1))) 2>/dev/null | BRIDGE | cat ;;\n"
           "  *) exec BRIDGE ;;\n"
           "esac\n");
  const std::vector<Json> documents = nodal_json({"calibration", "upload", path("long.json")});
  ASSERT_EQ(documents.size(), 1U);
  EXPECT_EQ(documents[0]["links"], 3);
  EXPECT_GT(documents[0]["resumed_at"], 300'000);
  EXPECT_EQ(nodal_json({"status"}).at(0)["calibration_name"], "long");
}

}  // namespace
}  // namespace nodal::command_line
