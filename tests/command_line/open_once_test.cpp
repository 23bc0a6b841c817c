// How often `nodal stitch` opens the pictures it was given.
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <map>
#include <string>

#include "stitch_command.h"

namespace nodal::command_line {
namespace {

/// Counts how often each file of a folder is opened to read or write, by the kernel's own count.
class Opens {
 public:
  explicit Opens(const std::string& folder) : notices_(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {
    EXPECT_GE(::inotify_add_watch(notices_, folder.c_str(), IN_OPEN), 0);
  }
  ~Opens() { ::close(notices_); }
  Opens(const Opens&) = delete;
  Opens& operator=(const Opens&) = delete;

  std::map<std::string, int> count() const {
    std::map<std::string, int> counts;
    alignas(inotify_event) std::array<char, 65536> bytes{};
    for (ssize_t size = 0; (size = ::read(notices_, bytes.data(), bytes.size())) > 0;) {
      for (ssize_t at = 0; at < size;) {
        inotify_event event{};
        std::memcpy(&event, bytes.data() + at, sizeof event);
        if (event.len > 0) ++counts[bytes.data() + at + sizeof event];
        at += static_cast<ssize_t>(sizeof event + event.len);
      }
    }
    return counts;
  }

 private:
  int notices_;
};

class OpenOnce : public StitchCommand {};

TEST_F(OpenOnce, PicturesWithoutACalibration_EachIsOpenedOnce) {
  write_pictures("pictures");
  const Opens opens(path("pictures"));
  Words words{"stitch"};
  for (std::size_t h = 0; h < town().bytes.size(); ++h) words.push_back(path("pictures/" + name_of(h) + ".png"));
  words.insert(words.end(), {"-o", path("sphere.png"), "--width", "256"});
  const Finished run = nodal(words);
  ASSERT_EQ(run.code, 0) << run.err;
  const auto counts = opens.count();
  EXPECT_EQ(counts.size(), town().bytes.size());
  for (const auto& [file, times] : counts) EXPECT_EQ(times, 1) << file;
}

TEST_F(OpenOnce, PicturesOfACalibration_EachIsOpenedOnce) {
  write_pictures("pictures");
  const Opens opens(path("pictures"));
  const Finished run =
      nodal({"stitch", path("rig.json"), path("pictures"), "-o", path("sphere.png"), "--width", "256"});
  ASSERT_EQ(run.code, 0) << run.err;
  for (const auto& [file, times] : opens.count()) EXPECT_EQ(times, 1) << file;
}

}  // namespace
}  // namespace nodal::command_line
