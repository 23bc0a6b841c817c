// The measurement of a control latency, on a rig that states its exposures too early, or whose latency varies.
#include "host_tool/input/control_latency.h"

#include <gtest/gtest.h>

#include "fake_rig.h"

namespace nodal::host {
namespace {

constexpr std::int64_t kPeriodNs = 4'000'000;
constexpr int kSide = 16;

/// Answers as a rig with one grey head of 16x16, whose brightness is its exposure. One frame passes with each frame
/// set.
class SlowHead {
 public:
  SlowHead(std::vector<int> seen_after, int stated_after)
      : seen_after_(std::move(seen_after)), stated_after_(stated_after) {
    rig_.answer = [this](const wire::Request& request) { return answer(request); };
    head_.set_name("cam0");
    head_.set_exposure_ns(2'000'000);
    head_.set_exposure_min_ns(100'000);
    head_.set_exposure_max_ns(3'000'000);
  }

  Result<ControlLatency> measure() {
    auto connection = RigConnection::over(std::move(rig_.host_end), "fake", Duration::seconds(60), rig_.waiter());
    if (!connection) return fail(connection.error());
    return measure_control_latency(**connection, head_, [](int) {});
  }
  bool restored() const { return restored_; }

 private:
  struct Given {
    std::uint64_t exposure_ns;
    int seen_from, stated_from;  ///< frames
  };

  std::optional<wire::Reply> answer(const wire::Request& request) {
    wire::Reply reply;
    if (request.has_genlock()) {
      reply.mutable_genlock()->set_rate_numerator(250);
      reply.mutable_genlock()->set_rate_denominator(1);
    } else if (request.has_head_set()) {
      EXPECT_TRUE(request.head_set().temporary()) << "the rig undoes it";
      if (!request.head_set().has_exposure_ns()) {
        restored_ = true;
        reply.mutable_done();
        return reply;
      }
      const int after = seen_after_[given_.size() % seen_after_.size()];
      given_.push_back({request.head_set().exposure_ns(), frame_ + 1 + after, frame_ + 1 + stated_after_});
      reply.mutable_done()->set_at_ns(static_cast<std::uint64_t>(frame_ * kPeriodNs + kPeriodNs / 2));
    } else if (request.has_frame_set()) {
      const auto stream = rig_.session().open_stream(StreamPolicy::kLossless);
      EXPECT_TRUE(stream);
      reply.mutable_pull()->set_stream(*stream);
      ++frame_;
      EXPECT_TRUE(rig_.session().offer(*stream, frame()));
      rig_.session().close_stream(*stream);
    }
    return reply;
  }

  BulkItem frame() const {
    std::uint64_t seen = 2'000'000;
    std::uint64_t stated = 2'000'000;
    for (const Given& given : given_) {
      if (frame_ >= given.seen_from) seen = given.exposure_ns;
      if (frame_ >= given.stated_from) stated = given.exposure_ns;
    }
    wire::FrameSetHeader header;
    header.set_set(static_cast<std::uint64_t>(frame_));
    header.set_mid_exposure_ns(static_cast<std::uint64_t>(frame_ * kPeriodNs) + stated / 2);
    wire::HeadPicture& picture = *header.add_heads();
    picture.set_name("cam0");
    picture.set_format("GREY");
    picture.set_width(kSide);
    picture.set_height(kSide);
    picture.set_exposure_ns(stated);
    const auto level = static_cast<std::uint8_t>(seen / 10'000);
    BulkItem item;
    item.meta = header.SerializeAsString();
    item.body = std::make_shared<const std::vector<std::uint8_t>>(kSide * kSide, level);
    return item;
  }

  FakeRig rig_;
  wire::HeadState head_;
  const std::vector<int> seen_after_;
  const int stated_after_;
  std::vector<Given> given_;
  int frame_ = 100;
  bool restored_ = false;
};

TEST(ControlLatency, ARigThatStatesTheExposureAFrameEarly_IsFound) {
  SlowHead head({3}, 2);
  const auto measured = head.measure();
  ASSERT_TRUE(measured) << measured.error().text();
  EXPECT_EQ(measured->seen.low(), 3);
  EXPECT_EQ(measured->seen.high(), 3);
  EXPECT_EQ(measured->stated.low(), 2);
  EXPECT_EQ(measured->stated.high(), 2);
  EXPECT_DOUBLE_EQ(measured->brightness, 200);
  EXPECT_DOUBLE_EQ(measured->stepped_brightness, 100);
  EXPECT_TRUE(head.restored());
}

TEST(ControlLatency, ThatVaries_IsNotExact) {
  SlowHead head({1, 1, 4}, 2);
  const auto measured = head.measure();
  ASSERT_TRUE(measured) << measured.error().text();
  EXPECT_FALSE(measured->seen.exact());
  EXPECT_EQ(measured->seen.high(), 1) << "the shortest";
  EXPECT_EQ(measured->seen.low(), 4) << "the longest";
}

TEST(ControlLatency, AHeadThatNeverChanges_IsAnError) {
  SlowHead head({1'000'000}, 2);
  const auto measured = head.measure();
  ASSERT_FALSE(measured);
  EXPECT_EQ(measured.error().code, Errc::kWrongState) << measured.error().text();
}

}  // namespace
}  // namespace nodal::host
