// What a take lacks and its rates, counted from evidence that is made by hand; and what a manifest may say.
#include "protocol/take/tally.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "protocol/take/documents.h"
#include "protocol/take/limits.h"
#include "protocol/take/matroska_writer.h"

namespace nodal::take {
namespace {

constexpr FrameRate kFifty{50, 1};

/// A set of one head, `at_ms` after the first.
wire::Set set_at(std::uint64_t index, std::uint64_t number, std::int64_t at_ms, const std::string& placeholder = "") {
  wire::Set set;
  set.set_index(index);
  set.set_number(number);
  set.set_mid_exposure_ns(1'000'000'000 + at_ms * 1'000'000);
  set.add_frames()->set_placeholder(placeholder);
  return set;
}

Segment segment_of(std::vector<wire::Set> sets, FrameRate rate = kFifty) {
  Segment segment;
  segment.begin.set_first_set(sets.front().index());
  segment.begin.set_rate_numerator(rate.numerator);
  segment.begin.set_rate_denominator(rate.denominator);
  segment.begin.add_files()->set_head(1);
  segment.sets = std::move(sets);
  return segment;
}

TEST(Tally, FiveSecondsWithoutASet_AreSetsThatWereNotCapturedInOneGap) {
  std::vector<wire::Set> sets;
  for (std::uint64_t k = 0; k < 10; ++k) sets.push_back(set_at(k, k, static_cast<std::int64_t>(20 * k)));
  for (std::uint64_t k = 10; k < 20; ++k) sets.push_back(set_at(k, k, static_cast<std::int64_t>(20 * k) + 5000));
  Tally tally;
  std::vector<Gap> found;
  tally.add(tally_of(segment_of(sets), {}, [&](const Gap& gap) { found.push_back(gap); }));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].before, 10U);
  EXPECT_EQ(found[0].capture, 250U);
  EXPECT_EQ(found[0].sets(), 250U);
  EXPECT_EQ(found[0].length, Duration::seconds(5));
  EXPECT_EQ(tally.gaps().count, 1U);
  EXPECT_EQ(tally.gaps().longest_before, 10U);
}

TEST(Tally, NumbersThatAreLeftOut_AreLostByTheDiskAndNotByCapture) {
  wire::Set after = set_at(1, 11, 220);
  after.set_missed(6);  // the other four never reached the recorder
  const SegmentTally tally = tally_of(segment_of({set_at(0, 0, 0), after}), {});
  EXPECT_EQ(tally.gaps().slow, 10U);
  EXPECT_EQ(tally.gaps().capture, 0U);
  EXPECT_EQ(tally.gaps().error, 0U);
}

TEST(Tally, SetsBetweenSegments_AreLostByAnErrorIfTheNextSaysSo) {
  Segment second = segment_of({set_at(1, 4, 80)});
  Tally slow, error;
  slow.add(tally_of(segment_of({set_at(0, 0, 0)}), {}));
  error.add(tally_of(segment_of({set_at(0, 0, 0)}), {}));
  slow.add(tally_of(second, {}));
  second.begin.set_after_error(true);
  const auto gap = error.add(tally_of(second, {}));
  EXPECT_EQ(slow.gaps().slow, 3U);
  EXPECT_EQ(error.gaps().error, 3U);
  EXPECT_EQ(error.gaps().slow, 0U);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap->length, Duration::milliseconds(60));
}

TEST(Tally, SegmentsThatWereDeletedInBetween_AreNoGap) {
  Tally tally;
  tally.add(tally_of(segment_of({set_at(0, 0, 0)}), {}));
  EXPECT_FALSE(tally.add(tally_of(segment_of({set_at(500, 500, 10'000)}), {})));
  EXPECT_EQ(tally.gaps().count, 0U);
}

TEST(Tally, PlaceholdersAndRates_AreCountedByHeadAndNamedFromTheirSet) {
  Tally tally;
  tally.add(tally_of(segment_of({set_at(0, 0, 0, "missing"), set_at(1, 1, 20, "format")}), {}));
  tally.add(tally_of(segment_of({set_at(2, 2, 60, "encoder"), set_at(3, 3, 100)}, {25, 1}), {}));
  tally.add(tally_of(segment_of({set_at(4, 4, 140)}, {25'000, 1'001}), {}));
  EXPECT_EQ(tally.heads()[1], (HeadGaps{1, 1, 1}));
  EXPECT_EQ(tally.heads()[0].sum(), 0U);
  ASSERT_EQ(tally.rates().size(), 2U) << "999 ppm are one rate, measured twice";
  EXPECT_EQ(tally.rates()[0], (RateChange{0, kFifty}));
  EXPECT_EQ(tally.rates()[1], (RateChange{2, {25, 1}}));
}

TEST(Tally, EvidenceAtItsExtremes_GivesSumsWithinTheirLimits) {
  wire::Set first = set_at(0, 0, 0), last = set_at(1, UINT64_MAX, 0);
  first.set_mid_exposure_ns(-kMaxTimeNs);
  last.set_mid_exposure_ns(kMaxTimeNs);
  last.set_missed(UINT64_MAX);
  Tally tally;
  for (int k = 0; k < 3; ++k) tally.add(tally_of(segment_of({first, last}, {1000, 1}), {}));
  EXPECT_LE(tally.gaps().slow, kMaxSets);
  EXPECT_LE(tally.gaps().sets(), 3 * kMaxSets);
}

TEST(Manifest, OfWhatIsBeyondEveryLimit_IsCutToWhatItsReaderAccepts) {
  Manifest manifest;
  manifest.number = 7;
  manifest.sets = manifest.lost_sets = manifest.deleted_sets = std::uint64_t{1} << 63;
  manifest.length = Duration::nanoseconds(-5);
  manifest.ended = std::string(1000, 'x') + "\x1b[2J";
  manifest.gaps = {1, 2, 3, 4, Duration::nanoseconds(INT64_MAX), 5};
  for (std::size_t k = 0; k < kMaxMarks + 5; ++k)
    manifest.marks.push_back({UINT64_MAX, "a\nb\x07" + std::string(500, 'c')});
  for (std::size_t k = 0; k < kMaxRates + 5; ++k) manifest.rates.push_back({k, kFifty});
  EXPECT_FALSE(parse_manifest(manifest_json(manifest), "manifest"));
  const auto read = parse_manifest(manifest_json(within_limits(manifest)), "manifest");
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->marks.size(), kMaxMarks);
  EXPECT_EQ(read->marks[0].text.substr(0, 5), "a?b?c");
}

TEST(Manifest, CalibrationsAboveTheirNumber_EndWithOneThatIsNotStored) {
  std::vector<Manifest::Calibration> all;
  for (std::size_t k = 1; k <= kMaxCalibrations; ++k) {
    const Manifest::Calibration next{calibration_file(k), std::string(64, 'a'), k};
    ASSERT_TRUE(check_next(next, all));
    all.push_back(next);
  }
  const Manifest::Calibration stored{calibration_file(all.size() + 1), std::string(64, 'a'), 2000};
  const Manifest::Calibration left_out{"", std::string(64, 'a'), std::uint64_t{1} << 63};
  EXPECT_FALSE(check_next(stored, all));
  ASSERT_TRUE(check_next(left_out, all));
  all.push_back(left_out);
  EXPECT_FALSE(check_next(left_out, all)) << "nothing comes after it";
}

TEST(Matroska, OfAKnownTime_HasADateAndTheOrderOfItsFields) {
  VideoTrack track;
  track.width = 4, track.height = 4;
  track.fields = Fields::kBottomFirst;
  track.utc_ns = (std::int64_t{978'307'200} + 86'400) * 1'000'000'000;  // 2001-01-02
  // DateUTC (RFC 9559) with 8 bytes: 86 400 s in ns is 0x4E94914F0000.
  const std::vector<std::uint8_t> date{0x44, 0x61, 0x88, 0, 0, 0x4E, 0x94, 0x91, 0x4F, 0, 0};
  const auto has = [&](const std::vector<std::uint8_t>& bytes) {
    const auto head = MatroskaWriter(track).head();
    return std::ranges::search(head, bytes).begin() != head.end();
  };
  EXPECT_TRUE(has(date));
  EXPECT_TRUE(has({0x9D, 0x81, 14})) << "rows alternate";
  track.fields_apart = true;
  EXPECT_TRUE(has({0x9D, 0x81, 6})) << "the bottom field is stored and shown first";
  track.fields = Fields::kTopFirst;
  EXPECT_TRUE(has({0x9D, 0x81, 1}));
  track.utc_ns.reset();
  EXPECT_FALSE(has({0x44, 0x61, 0x88}));
}

}  // namespace
}  // namespace nodal::take
