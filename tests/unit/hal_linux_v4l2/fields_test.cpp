// Interlaced heads whose drivers deliver each field by itself.
#include <gtest/gtest.h>

#include "head_fixture.h"

namespace nodal::hal::v4l2 {
namespace {

/// The driver fills the buffer of its n-th picture with 37 n, 37 n + 1, 37 n + 2 and so on.
int expected_byte(int n, std::ptrdiff_t offset) { return static_cast<int>((37 * n + offset) & 255); }

class AlternateFields : public V4l2HeadTest {
 protected:
  AlternateFields() {
    driver_.field = V4L2_FIELD_ALTERNATE;
    driver_.standard = V4L2_STD_NTSC;  // the bottom field first
    driver_.height = 16;
    request_.fields = Fields::kBottomFirst;
  }
  /// Whether rows of this parity hold the driver's n-th field.
  void expect_field(const ImageView& frame, FieldParity parity, int n) {
    const std::ptrdiff_t stride = 48 * 2 + driver_.padding;
    for (int row = 0; row < 16; ++row) {
      const int y = 2 * row + (parity == FieldParity::kBottom ? 1 : 0);
      for (int x = 0; x < 48; ++x) {
        ASSERT_EQ(frame.planes[0].data[y * frame.planes[0].row_stride + 2 * x], expected_byte(n, row * stride + 2 * x))
            << "row " << y << " pixel " << x;
      }
    }
  }
};

TEST_F(AlternateFields, TwoFieldsOfASequenceNumber_AreOneFrameTimedByTheFirst) {
  const auto head = streaming();
  EXPECT_EQ(head->format().height, 32);
  EXPECT_EQ(head->format().fields, Fields::kBottomFirst);
  const auto frame = next(*head);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->fields, Fields::kBottomFirst);
  EXPECT_EQ(frame->verdict, FrameVerdict::kGood);
  EXPECT_EQ(frame->image.height, 32);
  expect_field(frame->image, FieldParity::kBottom, 0);
  expect_field(frame->image, FieldParity::kTop, 1);
  const auto second = next(*head);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->sequence, frame->sequence + 1);
  const Duration period = head->format().rate.period();
  EXPECT_NEAR(static_cast<double>((second->mid_exposure - frame->mid_exposure).us()), static_cast<double>(period.us()),
              2);
  // Exposed, then read for half a period; then the second field is read. The test looks every few milliseconds.
  const Duration arrival = frame->received - frame->mid_exposure;
  EXPECT_GE(arrival, period + frame->in_effect.exposure.duration() / 2);
  EXPECT_LT(arrival, period * 3 / 2);
}

TEST_F(AlternateFields, AFieldThatIsLost_LeavesAFrameOfOneFieldAndTheNextIsWhole) {
  driver_.lost_fields = {3};  // the top field of the second frame
  const auto head = streaming();
  std::vector<Fields> fields;
  std::vector<std::uint32_t> sequence;
  for (int i = 0; i < 4; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    fields.push_back(frame->fields);
    sequence.push_back(frame->sequence);
    if (i == 1) expect_field(frame->image, FieldParity::kBottom, 2);
    if (i == 2) expect_field(frame->image, FieldParity::kTop, 5);
    head->release(frame->slot);
  }
  EXPECT_EQ(fields,
            (std::vector{Fields::kBottomFirst, Fields::kBottomOnly, Fields::kBottomFirst, Fields::kBottomFirst}));
  EXPECT_EQ(sequence, (std::vector<std::uint32_t>{0, 1, 2, 3}));
}

TEST_F(AlternateFields, AFirstFieldThatIsLost_TheSecondAloneSaysSo) {
  driver_.lost_fields = {2};
  const auto head = streaming();
  ASSERT_TRUE(next(*head));
  const auto frame = next(*head);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->fields, Fields::kTopOnly);
}

TEST_F(AlternateFields, EveryFrameIsHeld_FieldsAreDroppedAndFramesComeAgainAfterRelease) {
  const auto head = streaming();
  std::vector<FrameView> held;
  for (int i = 0; i < request_.buffers; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame) << i;
    held.push_back(*frame);
  }
  clock_.advance(head->format().rate.period() * 3);
  EXPECT_FALSE(head->take_frame().value());
  expect_field(held.front().image, FieldParity::kBottom, 0);
  for (const FrameView& frame : held) head->release(frame.slot);
  const auto again = next(*head);
  ASSERT_TRUE(again);
  EXPECT_GT(again->sequence, held.back().sequence + 2);
}

TEST_F(V4l2HeadTest, SequentialFields_AreTakenApart) {
  driver_.field = V4L2_FIELD_SEQ_BT;
  request_.fields = Fields::kBottomFirst;
  const auto head = streaming();
  const auto frame = next(*head);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->fields, Fields::kBottomFirst);
  const std::ptrdiff_t stride = 48 * 2 + driver_.padding;
  for (int y = 0; y < 32; ++y) {
    // The bottom field's rows are the first 16 of the buffer.
    const std::ptrdiff_t row = y % 2 == 1 ? y / 2 : 16 + y / 2;
    EXPECT_EQ(frame->image.planes[0].data[y * frame->image.planes[0].row_stride], expected_byte(0, row * stride)) << y;
  }
}

TEST_F(V4l2HeadTest, SequentialFieldsOfAPlanarFormat_AreRefused) {
  driver_.field = V4L2_FIELD_SEQ_TB;
  request_.fields = Fields::kTopFirst;
  request_.pixels = PixelFormat::kI420;
  const auto opened = open();
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().message.find("one after the other"), std::string::npos) << opened.error().message;
}

}  // namespace
}  // namespace nodal::hal::v4l2
