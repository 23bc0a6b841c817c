#include "firmware/operate/news.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "protocol/base/text.h"

namespace nodal::firmware {
namespace {

constexpr std::array<std::string_view, kNewsKinds> kAbout = {"hosts", "the rig", "changes"};

}  // namespace

News::News(Instant now) {
  for (Bucket& bucket : buckets_) bucket.filled = bucket.summed_up = now;
}

void News::step(Instant now) {
  for (std::size_t kind = 0; kind < kNewsKinds; ++kind) {
    Bucket& bucket = buckets_[kind];
    const std::int64_t seconds = (now - bucket.filled).ms() / 1000;
    // Seconds; a longer time could overflow the product.
    constexpr std::int64_t kFullWithin = 2 * kBurstBytes / kBytesASecond;
    bucket.bytes = std::min(kBurstBytes, bucket.bytes + kBytesASecond * std::min(seconds, kFullWithin));
    bucket.filled = bucket.filled + Duration::seconds(seconds);
    if (bucket.left_out == 0) {
      bucket.summed_up = now;
      continue;
    }
    const Duration since = now - bucket.summed_up;
    if (since < kSummaryEvery) continue;
    sentences_.push_back(fmt::format("{} messages about {} left out in the last {} s", bucket.left_out, kAbout[kind],
                                     since.ms() / 1000));
    bucket.left_out = 0;
    bucket.summed_up = now;
  }
}

void News::say(NewsKind kind, std::string_view sentence) {
  Bucket& bucket = buckets_[static_cast<std::size_t>(kind)];
  if (bucket.bytes <= 0) {
    ++bucket.left_out;
    return;
  }
  sentences_.push_back(printable(sentence, kLongestSentence));
  bucket.bytes -= static_cast<std::int64_t>(sentences_.back().size()) + kLineBytes;
}

std::vector<std::string> News::take() { return std::exchange(sentences_, {}); }

}  // namespace nodal::firmware
