#include "firmware/record/host_disk_test.h"

#include <algorithm>
#include <string>
#include <utility>

#include "firmware/record/head_coder.h"
#include "firmware/record/take_description.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

std::optional<std::uint32_t> HostDiskTest::percent(Instant now) const {
  return test_ ? std::optional(test_->test->percent(now)) : std::nullopt;
}

Status HostDiskTest::begin(const TakeRequest& request, const TakeRequest::TestDisk& what, Instant now) {
  if (test_) {  // it lasts no longer than they asked for
    mail_.let_wait(test_->tickets, request);
    test_->test->end_after(std::max(what.length, TakeRequest::TestDisk::kShared));
    return {};
  }
  if (set_bytes(config_, what.heads) == 0) {
    return fail(Errc::kNotReady,
                "no head has delivered a picture yet, so nothing is known of what they need; `nodal "
                "heads` says why");
  }
  NODAL_TRY_ASSIGN(auto held, shelf_.hold());
  NODAL_TRY_ASSIGN(auto test, DiskTest::begin(disk_, what.length, now));
  test_.emplace(Test{{}, std::move(held), what.heads, what.rate.value_or(config_.rate), std::move(test)});
  mail_.let_wait(test_->tickets, request);
  return {};
}

bool HostDiskTest::step(Instant now) {
  if (!test_) return false;
  if (mail_.drop_gone(test_->tickets) && test_->tickets.empty()) {  // nobody waits for the result any more
    test_.reset();
    return true;
  }
  const auto speed = test_->test->step(now);
  if (!speed) end(fail(speed.error()));
  else if (*speed) end(judged(**speed));
  return true;
}

TakeAnswer::DiskTested HostDiskTest::judged(const DiskSpeed& speed) const {
  TakeAnswer::DiskTested tested{speed, {}};
  const auto judge = [&](const std::string& name, std::optional<TakeMode> mode) {
    const std::uint64_t bytes = set_bytes(config_, test_->heads, mode);
    const std::uint64_t needed = bytes * test_->rate.numerator / test_->rate.denominator;
    tested.modes.push_back(judge_disk(speed, name, needed, buffer_));
  };
  const std::string own = mode_names(config_.heads);
  if (own.find(',') != std::string::npos) judge(own, std::nullopt);
  for (const TakeMode mode : {TakeMode::kDriver, TakeMode::kRaw, TakeMode::kLossless, TakeMode::kJpeg}) {
    judge(std::string(mode_name(mode)), mode);
  }
  return tested;
}

void HostDiskTest::end(const Result<TakeMailbox::Answered>& result) {
  if (!test_) return;
  WaitingTickets tickets = std::move(test_->tickets);
  test_.reset();
  mail_.answer(tickets, result);
}

}  // namespace nodal::firmware
