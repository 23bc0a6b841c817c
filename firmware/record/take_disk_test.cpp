// The part of TakeKeeper that tests the disk for a host.
#include <algorithm>
#include <utility>

#include "firmware/record/head_coder.h"
#include "firmware/record/take_keeper.h"
#include "firmware/record/take_writer.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

/// Bytes of a set in this mode, or, without a mode, in each head's own one. Lossless counts as raw, because noise may
/// leave nothing for Ut Video to save.
std::uint64_t TakeKeeper::set_bytes(const HeadShapes& heads, std::optional<TakeMode> mode) const {
  std::uint64_t sum = 0;
  for (std::size_t k = 0; k < heads.size(); ++k) {
    if (!heads[k]) continue;
    const HeadStream delivered{heads[k]->format, heads[k]->width, heads[k]->height, {}, Fields::kProgressive, false};
    const HeadStream stored =
        stored_stream(delivered, mode.value_or(config_.heads[k].take_mode), config_.raymap.format);
    // A camera's JPEG has about one bit per sample, one of quality 90 about two; the first sets tell more.
    const bool as_sent = delivered.format == PixelFormat::kMjpeg;
    if (stored.format != PixelFormat::kMjpeg) sum += packed_size(stored.format, stored.width, stored.height);
    else if (as_sent) sum += packed_size(PixelFormat::kI420, stored.width, stored.height) / 8;
    else sum += packed_size(delivered.format, delivered.width, delivered.height) / 4;
  }
  return sum;
}

Status TakeKeeper::begin_test(const TakeRequest& request, const TakeRequest::TestDisk& what, Instant now) {
  if (writing_) return fail(Errc::kBusy, "a take is being recorded; test the disk when none is");
  if (test_) {  // one test answers all who wait, and lasts no longer than they asked for
    let_wait(test_->tickets, request);
    test_->test->end_after(std::max(what.length, TakeRequest::TestDisk::kShared));
    return {};
  }
  if (set_bytes(what.heads) == 0) {
    return fail(Errc::kNotReady,
                "no head has delivered a picture yet, so nothing is known of what they need; `nodal "
                "heads` says why");
  }
  NODAL_TRY_ASSIGN(auto held, shelf_.hold());
  NODAL_TRY_ASSIGN(auto test, DiskTest::begin(disk_, what.length, now));
  rate_ = what.rate.value_or(config_.rate);
  test_.emplace(Test{{}, std::move(held), what.heads, std::move(test)});
  let_wait(test_->tickets, request);
  return {};
}

bool TakeKeeper::step_test(Instant now) {
  if (!test_) return false;
  if (drop_gone(test_->tickets) && test_->tickets.empty()) {  // nobody waits for the result any more
    test_.reset();
    return true;
  }
  const auto speed = test_->test->step(now);
  if (!speed) end_test(fail(speed.error()));
  if (!speed || !*speed) return true;
  TakeAnswer::DiskTested tested{**speed, {}};
  const auto judge = [&](const std::string& name, std::optional<TakeMode> mode) {
    const std::uint64_t needed = set_bytes(test_->heads, mode) * rate_.numerator / rate_.denominator;
    tested.modes.push_back(judge_disk(**speed, name, needed, recorder_.ring().size()));
  };
  const std::string own = mode_names(config_.heads);
  if (own.find(',') != std::string::npos) judge(own, std::nullopt);
  for (const TakeMode mode : {TakeMode::kDriver, TakeMode::kRaw, TakeMode::kLossless, TakeMode::kJpeg}) {
    judge(std::string(mode_name(mode)), mode);
  }
  end_test(std::move(tested));
  return true;
}

/// The file is removed before the answer goes.
void TakeKeeper::end_test(Result<TakeAnswer::DiskTested> result) {
  WaitingTickets tickets = std::move(test_->tickets);
  test_.reset();
  while (const auto ticket = tickets.next()) {
    if (result) answer(*ticket, *result);
    else answer(*ticket, fail(result.error()));
  }
}

}  // namespace nodal::firmware
