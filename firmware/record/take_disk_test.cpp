// The part of TakeKeeper that tests the disk for a host.
#include <utility>

#include "firmware/record/head_coder.h"
#include "firmware/record/take_keeper.h"
#include "firmware/record/take_writer.h"

namespace nodal::firmware {

/// Of a set as the mode stores it.
std::uint64_t TakeKeeper::set_bytes(const HeadShapes& heads, TakesConfig::Mode mode) const {
  std::uint64_t sum = 0;
  for (const auto& head : heads) {
    if (!head) continue;
    const bool jpeg = head->format == PixelFormat::kMjpeg;
    const bool coded =
        HeadCoder::codes({head->format, head->width, head->height, {}, Fields::kProgressive, false}, mode) &&
        mode == TakesConfig::Mode::kJpeg;  // noise may leave nothing for Ut Video to save
    // A camera's JPEG has about one bit per sample, one of quality 90 about two; the first sets tell more.
    sum += packed_size(jpeg ? PixelFormat::kI420 : head->format, head->width, head->height) / (jpeg    ? 8
                                                                                               : coded ? 4
                                                                                                       : 1);
  }
  return sum;
}

Status TakeKeeper::begin_test(std::uint64_t ticket, const TakeRequest::TestDisk& what, Instant now) {
  if (writing_) return fail(Errc::kBusy, "a take is being recorded; test the disk when none is");
  if (test_) return fail(Errc::kBusy, "the disk is being tested; try again in a minute");
  if (set_bytes(what.heads, TakesConfig::Mode::kDriver) == 0) {
    return fail(Errc::kNotReady,
                "no head has delivered a picture yet, so nothing is known of what they need; `nodal "
                "heads` says why");
  }
  auto test = DiskTest::begin(disk_, what.length, now);
  if (!test) return fail(test.error());
  test_ = Test{ticket, what.heads, std::move(*test)};
  return {};
}

bool TakeKeeper::step_test(Instant now) {
  if (!test_) return false;
  const auto speed = test_->test->step(now);
  if (!speed) end_test(fail(speed.error()));
  if (!speed || !*speed) return true;
  TakeAnswer::DiskTested tested{**speed, {}};
  using Mode = TakesConfig::Mode;
  for (const Mode mode : {Mode::kDriver, Mode::kLossless, Mode::kJpeg}) {
    const std::uint64_t needed = set_bytes(test_->heads, mode) * config_.rate.numerator / config_.rate.denominator;
    tested.modes.push_back(judge_disk(**speed, std::string(mode_name(mode)), needed, recorder_.ring().size()));
  }
  end_test(std::move(tested));
  return true;
}

/// The file is removed before the answer goes.
void TakeKeeper::end_test(Result<TakeAnswer::DiskTested> result) {
  const std::uint64_t ticket = test_->ticket;
  test_.reset();
  if (result) answer(ticket, std::move(*result));
  else answer(ticket, fail(result.error()));
}

}  // namespace nodal::firmware
