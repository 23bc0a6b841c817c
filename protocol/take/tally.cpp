#include "protocol/take/tally.h"

#include <algorithm>
#include <utility>

#include "protocol/take/limits.h"

namespace nodal::take {
namespace {

std::uint64_t limited(std::uint64_t a, std::uint64_t b) {
  return std::min(kMaxSets, std::min(a, kMaxSets) + std::min(b, kMaxSets));
}
std::uint64_t without(std::uint64_t a, std::uint64_t b) { return a - std::min(a, b); }

}  // namespace

void add(Gaps& to, const Gap& gap) { add(to, {1, gap.slow, gap.error, gap.capture, gap.length, gap.before}); }

void add(Gaps& to, const Gaps& other) {
  to.count = limited(to.count, other.count);
  to.slow = limited(to.slow, other.slow);
  to.error = limited(to.error, other.error);
  to.capture = limited(to.capture, other.capture);
  if (other.longest <= to.longest) return;
  to.longest = other.longest;
  to.longest_before = other.longest_before;
}

void add(HeadGaps& to, const HeadGaps& other) {
  to.missing = limited(to.missing, other.missing);
  to.format = limited(to.format, other.format);
  to.encoder = limited(to.encoder, other.encoder);
}

void remove(Gaps& from, const Gaps& part) {
  from.count = without(from.count, part.count);
  from.slow = without(from.slow, part.slow);
  from.error = without(from.error, part.error);
  from.capture = without(from.capture, part.capture);
  if (from.count == 0) from = {};
}

void remove(HeadGaps& from, const HeadGaps& part) {
  from.missing = without(from.missing, part.missing);
  from.format = without(from.format, part.format);
  from.encoder = without(from.encoder, part.encoder);
}

FrameRate rate_of(const wire::Begin& begin, FrameRate otherwise) {
  return FrameRate::make(begin.rate_numerator(), begin.rate_denominator()).value_or(otherwise);
}

bool same_rate(FrameRate a, FrameRate b) {
  const std::int64_t period = a.period().ns();
  return abs(a.period() - b.period()).ns() <= period / 1000;
}

/// The rig numbers every set that it makes, so numbers that are left out were made and not recorded. Time in which no
/// number was given is time without capture. Where numbers are left out for long, their count is not exact by the time,
/// because the rate is known to 1000 ppm only.
Gap SegmentTally::between(const Moment& before, const Moment& after, Duration period, bool error) {
  Gap gap;
  gap.before = after.index;
  gap.at_ns = before.at_ns;
  const std::uint64_t left_out = after.number > before.number ? after.number - before.number - 1 : 0;
  gap.slow = std::min(after.missed, left_out);
  (error ? gap.error : gap.slow) += left_out - gap.slow;
  const std::int64_t step = after.at_ns > before.at_ns ? after.at_ns - before.at_ns : 0;
  const auto periods = static_cast<std::uint64_t>((step + period.ns() / 2) / std::max<std::int64_t>(1, period.ns()));
  const std::uint64_t expected = without(periods, 1);
  if (expected > left_out + left_out / 1000) gap.capture = expected - left_out;
  gap.length = Duration::nanoseconds(std::max<std::int64_t>(0, step - period.ns()));
  return gap;
}

std::optional<Gap> SegmentTally::add(const wire::Begin& begin, const wire::Set& set) {
  ++sets_;
  for (const wire::Frame& frame : set.frames()) {
    if (frame.placeholder().empty()) continue;
    HeadGaps& head = heads_[begin.files(static_cast<int>(frame.file())).head()];
    ++(frame.placeholder() == "format" ? head.format : frame.placeholder() == "encoder" ? head.encoder : head.missing);
  }
  const Moment now{set.index(), set.number(), set.missed(), set.mid_exposure_ns()};
  const std::optional<Moment> before = std::exchange(last_, now);
  if (!before) {
    first_ = now;
    after_error_ = begin.after_error();
    return std::nullopt;
  }
  const Gap gap = between(*before, now, rate_.period(), false);
  if (gap.sets() == 0) return std::nullopt;
  take::add(gaps_, gap);
  return gap;
}

SegmentTally tally_of(const Segment& segment, FrameRate otherwise, const std::function<void(const Gap&)>& found) {
  SegmentTally tally(rate_of(segment.begin, otherwise));
  for (const wire::Set& set : segment.sets) {
    const auto gap = tally.add(segment.begin, set);
    if (gap && found) found(*gap);
  }
  return tally;
}

std::optional<Gap> Tally::add(const SegmentTally& segment) {
  if (!segment.first_) return std::nullopt;
  take::add(gaps_, segment.gaps_);
  for (std::size_t head = 0; head < heads_.size(); ++head) take::add(heads_[head], segment.heads_[head]);
  if (rates_.empty() || !same_rate(rates_.back().rate, segment.rate_)) {
    if (rates_.size() < kMaxRates) rates_.push_back({segment.first_->index, segment.rate_});
  }
  const SegmentTally::Moment& first = *segment.first_;
  Gap gap;
  if (!last_) {
    gap = {first.index, first.at_ns, {}, first.missed, 0, 0};
    if (first.index != 0) gap.slow = 0;  // what came before was deleted
  } else if (last_->index + 1 == first.index) {
    const Duration period = std::max(last_rate_.period(), segment.rate_.period());
    gap = SegmentTally::between(*last_, first, period, segment.after_error_);
  }
  last_ = segment.last_;
  last_rate_ = segment.rate_;
  if (gap.sets() == 0) return std::nullopt;
  take::add(gaps_, gap);
  return gap;
}

}  // namespace nodal::take
