// nodald's memory on the board while it films the reference rigs for a host that pulls JPEGs.
#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <cstdio>
#include <fstream>
#include <string>

#include "tests/bench/workloads.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::bench {
namespace {

constexpr double kMiB = 1024.0 * 1024.0;

/// Writes a packed I420 picture as a JPEG that decodes to I420.
void write_jpeg(const std::filesystem::path& file, const ImageView& picture) {
  const tjhandle coder = tjInitCompress();
  unsigned char* jpeg = nullptr;
  unsigned long bytes = 0;
  const int failed = tjCompressFromYUV(coder, picture.planes[0].data, picture.width, 1, picture.height, TJSAMP_420,
                                       &jpeg, &bytes, 95, 0);
  EXPECT_EQ(failed, 0) << tjGetErrorStr2(coder);
  test::write_bytes(file, std::vector<std::uint8_t>(jpeg, jpeg + bytes));
  tjFree(jpeg);
  tjDestroy(coder);
}

/// In MiB, by /proc/PID/status.
struct Resident {
  double now = 0;   ///< total
  double own = 0;   ///< without the code of programs and libraries
  double most = 0;  ///< maximum since the start
};

Resident resident(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  Resident found;
  for (std::string key, rest; status >> key && std::getline(status, rest);) {
    if (key == "VmRSS:") found.now = std::stod(rest) / 1024;
    if (key == "RssAnon:") found.own = std::stod(rest) / 1024;
    if (key == "VmHWM:") found.most = std::stod(rest) / 1024;
  }
  return found;
}

/// A nodald with a rig whose heads repeat one picture each.
class MemoryOf {
 public:
  explicit MemoryOf(const Workload& work) : work_(work) {
    std::string toml = "[rig]\nname = \"" + work.name +
                       "\"\nrate = \"25\"\n[raymap]\nwidth = " + std::to_string(work.raymap.width) +
                       "\nheight = " + std::to_string(work.raymap.height) +
                       "\n[trigger]\nstart = true\n[links]\nunix = \"sock\"\n[store]\nfolder = \"store\"\n";
    const FilmedSet set = film(work.rig, PixelFormat::kI420, 1);
    for (std::size_t h = 0; h < set.heads.size(); ++h) {
      const std::string& name = work.rig.heads[h].name;
      write_jpeg(folder_ / (name + ".jpg"), set.heads[h]);
      toml += "[[heads]]\nname = \"" + name + "\"\nport = \"replay:" + name + ".jpg\"\n";
      pictures_ += static_cast<double>(set.memory[h].size()) / kMiB;
    }
    write("rig.toml", toml);
  }

  /// Measures after three calibrations, two of which were uploaded while another one was in use, and raymaps with each.
  /// One picture per head is included, because a camera's driver also keeps its frames in memory.
  Resident measure() {
    test::Process daemon(
        {NODAL_BIN_DIR "/nodald", "--config", (folder_ / "rig.toml").string(), "--blend-threads", "2"});
    EXPECT_TRUE(test::wait_until([&] { return nodal({"status"}).code == 0; })) << daemon.complained();
    say("started", resident(daemon.pid()));
    for (const char* name : {"first", "second", "third"}) {
      Calibration calibration = work_.rig;
      calibration.name = name;
      write("rig.json", to_json(calibration));
      const test::Finished uploaded = nodal({"calibration", "upload", (folder_ / "rig.json").string()});
      EXPECT_EQ(uploaded.code, 0) << uploaded.err;
      const test::Finished pulled = nodal({"raymap", "pull", "-n", "20", "--out", (folder_ / "%04d.jpg").string()});
      EXPECT_EQ(pulled.code, 0) << pulled.err;
      say(name, resident(daemon.pid()));
    }
    return resident(daemon.pid());
  }

 private:
  void write(const std::string& name, const std::string& text) {
    test::write_bytes(folder_ / name, std::vector<std::uint8_t>(text.begin(), text.end()));
  }
  test::Finished nodal(std::vector<std::string> words) {
    words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--rig", "unix:" + (folder_ / "sock").string()});
    return test::Process(words).wait(std::chrono::seconds(120));
  }
  void say(const char* when, const Resident& found) const {
    std::printf("%-4s %-8s %6.1f MiB, of it %5.1f without code, with %4.1f of heads' pictures; at most %6.1f\n",
                work_.name.c_str(), when, found.now, found.own, pictures_, found.most);
  }

  const Workload work_;
  test::TemporaryFolder folder_;
  double pictures_ = 0;
};

TEST(ResidentMemory, TenHeadsInto2048_FitInto40MiB) { EXPECT_LT(MemoryOf(r10()).measure().now, 40); }

TEST(ResidentMemory, EightFisheyesInto3840_FitInto140MiB) { EXPECT_LT(MemoryOf(r8()).measure().now, 140); }

}  // namespace
}  // namespace nodal::bench
