// A trace of a V4L2 head tells whoever connects a camera why no picture comes.
#include <algorithm>
#include <cerrno>
#include <mutex>
#include <vector>

#include "hal/linux/v4l2/traced_system.h"
#include "head_fixture.h"

namespace nodal::hal::v4l2 {
namespace {

class V4l2Trace : public V4l2HeadTest {
 protected:
  V4l2Trace() { enumerator_ = std::make_unique<V4l2Enumerator>(clock_, traced_); }
  ~V4l2Trace() override { enumerator_.reset(); }

  std::vector<std::string> lines() {
    const std::lock_guard lock(mutex_);
    return lines_;
  }
  std::string all() {
    std::string text;
    for (const std::string& line : lines()) text += line + "\n";
    return text;
  }
  bool has(const std::string& part) { return all().find(part) != std::string::npos; }

 private:
  std::mutex mutex_;
  std::vector<std::string> lines_;

 protected:
  TracedSystem traced_{driver_, clock_, [this](const std::string& line) {
                         const std::lock_guard lock(mutex_);
                         lines_.push_back(line);
                       }};
};

TEST_F(V4l2Trace, HeadThatStreams_IsTheSameAndEachCallHasALine) {
  driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = {1, 10000, 1, 156, 156};
  auto head = streaming();
  const auto first = next(*head);
  ASSERT_TRUE(first) << first.error().text();
  EXPECT_EQ(first->image.width, 48);
  head->release(first->slot);
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(5000)));
  enumerator_->settle();
  EXPECT_TRUE(has("/dev/video7: open\n")) << all();
  EXPECT_TRUE(has("VIDIOC_QUERYCAP -> driver ")) << all();
  EXPECT_TRUE(has(", card Camera, bus usb-1.2, ")) << all();
  // The driver adds 16 bytes to each row of 48 pixels of two bytes, and has 32 rows.
  EXPECT_TRUE(has("-> 48x32 YUYV, progressive, 3584 bytes, 112 a row")) << all();
  EXPECT_TRUE(has("/dev/video7: VIDIOC_STREAMON\n")) << all();
  EXPECT_TRUE(has("VIDIOC_DQBUF -> buffer 0, sequence 0, 3584 bytes, progressive")) << all();
  EXPECT_TRUE(has("VIDIOC_QBUF buffer 0\n")) << all();
  EXPECT_TRUE(has("VIDIOC_S_CTRL EXPOSURE_ABSOLUTE = 50 -> 50\n")) << all();
}

TEST_F(V4l2Trace, CallThatTheDriverRefuses_IsNamedWithItsError) {
  const Hook busy = before([](unsigned long request) { return request == VIDIOC_STREAMON ? EBUSY : 0; });
  auto head = open();
  ASSERT_TRUE(head) << head.error().text();
  (void)(*head)->start(TriggerMode::kFreeRun);
  enumerator_->settle();
  EXPECT_TRUE(has("/dev/video7: VIDIOC_STREAMON -> EBUSY (Device or resource busy)")) << all();
}

TEST_F(V4l2Trace, DeviceThatSendsNothing_HasALineASecondAndNoneForEachCall) {
  auto head = streaming();
  pass(period_ * 2);
  const auto frame = head->take_frame();
  ASSERT_TRUE(frame && *frame);
  const Hook silent = before([](unsigned long request) { return request == VIDIOC_DQBUF ? EAGAIN : 0; });
  const std::size_t before_silence = lines().size();
  for (int i = 0; i < 30; ++i) {
    clock_.advance(Duration::milliseconds(100));
    EXPECT_FALSE(head->take_frame().value_or(std::nullopt));
  }
  const std::vector<std::string> now = lines();
  const auto missing =
      std::count_if(now.begin() + static_cast<std::ptrdiff_t>(before_silence), now.end(),
                    [](auto& line) { return line.find("VIDIOC_DQBUF -> no frame for ") != std::string::npos; });
  EXPECT_EQ(missing, 3) << all();
  EXPECT_TRUE(has("no frame for 3000 ms, asked 10 times")) << all();
}

TEST_F(V4l2Trace, DeviceThatIsNotThere_ItsErrorIsWritten) {
  driver_.unplug();
  EXPECT_FALSE(open("v4l2:/dev/video7"));
  EXPECT_TRUE(has("/dev/video7: open -> E")) << all();
}

}  // namespace
}  // namespace nodal::hal::v4l2
