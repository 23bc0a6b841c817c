// Placed seams as records of the evidence: round trip, bounds, hostile maps.
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "protocol/framing.h"
#include "protocol/take/evidence.h"
#include "protocol/take/seam_map.h"

namespace nodal::take {
namespace {

using Labels = std::vector<std::uint8_t>;

constexpr std::size_t kPixels = std::size_t{kMaxSeamColumns} * kMaxSeamColumns / 2;

TEST(SeamMap, LabelsOfEveryRunLength_AreReadAsTheyWereWritten) {
  Labels labels;
  for (std::size_t length = 1; labels.size() + length < kPixels; ++length)
    labels.insert(labels.end(), length, length % 17 == 16 ? kNoHeadOfSeams : static_cast<std::uint8_t>(length % 17));
  labels.resize(kPixels, 3);
  const wire::Seams seams = seams_record(77, kMaxSeamColumns, labels);
  EXPECT_EQ(seams.set(), 77U);
  EXPECT_TRUE(check_seams(seams));
  EXPECT_EQ(labels_of(seams).value(), labels);
  const wire::Seams one = seams_record(0, kMaxSeamColumns, Labels(kPixels, 0));
  EXPECT_EQ(one.runs().size(), 4U);
  EXPECT_EQ(labels_of(one).value(), Labels(kPixels, 0));
}

TEST(SeamMap, Noise_TakesAByteAPixelAtMostAndFitsARecord) {
  std::mt19937 random(1);
  Labels labels(kPixels);
  for (std::uint8_t& label : labels) label = static_cast<std::uint8_t>(random() % 16);
  wire::Record record;
  *record.mutable_seams() = seams_record(UINT64_MAX, kMaxSeamColumns, labels);
  EXPECT_LE(record.seams().runs().size(), kPixels);
  EXPECT_LE(record.ByteSizeLong(), kMaxTakeRecordBytes);
  EXPECT_EQ(labels_of(record.seams()).value(), labels);
}

TEST(SeamMap, OfTheCalibrationsOwnSeams_IsEmpty) {
  const wire::Seams seams = seams_record(5, kMaxSeamColumns, {});
  EXPECT_EQ(seams.columns(), 0U);
  EXPECT_TRUE(check_seams(seams));
  EXPECT_TRUE(labels_of(seams).value().empty());
}

TEST(SeamMap, HostileMaps_AreRefusedWithTheirSet) {
  const wire::Seams good = seams_record(1234, kMaxSeamColumns, Labels(kPixels, 2));
  EXPECT_TRUE(check_seams(good, 3));
  const std::string runs = good.runs();
  struct Case {
    std::string what;
    std::uint32_t columns;
    std::string runs;
    std::size_t heads = kMaxHeads;
  };
  const std::vector<Case> cases = {
      {"nothing", kMaxSeamColumns, ""},
      {"a pixel more", kMaxSeamColumns, runs + '\x02'},
      {"a run cut off", kMaxSeamColumns, runs.substr(0, 3)},
      {"a length without end", kMaxSeamColumns, std::string("\xe2") + std::string(60'000, '\xff')},
      {"runs of more than 32 bits together", kMaxSeamColumns, std::string(60'000, '\xe2')},
      {"a head that no rig has", kMaxSeamColumns, '\xf0' + runs.substr(1)},
      {"a head that the take does not have", kMaxSeamColumns, runs, 2},
      {"runs without columns", 0, runs},
      {"more columns than there may be", kMaxSeamColumns + 2, runs},
      {"very many columns", UINT32_MAX - 1, runs},
      {"an odd number of columns", kMaxSeamColumns - 1, runs},
  };
  for (const Case& each : cases) {
    wire::Seams seams = good;
    seams.set_columns(each.columns);
    seams.set_runs(each.runs);
    const Status checked = check_seams(seams, each.heads);
    ASSERT_FALSE(checked) << each.what;
    EXPECT_NE(checked.error().message.find("the seams from set 1234 on"), std::string::npos) << checked.error().text();
    if (each.heads == kMaxHeads) {
      EXPECT_FALSE(labels_of(seams)) << each.what;
    }
  }
}

TEST(SeamMap, InEvidence_AreReadAndThoseThatContradictEachOtherAreNot) {
  const auto read = [](std::vector<wire::Seams> all) {
    wire::Record begin;
    begin.mutable_begin()->set_version(1);
    wire::File& file = *begin.mutable_begin()->add_files();
    file.set_name("cam0-0000.mkv");
    file.set_head(0);
    file.set_format("GREY");
    file.set_width(4);
    file.set_height(2);
    EvidenceWriter writer;
    std::vector<std::uint8_t> bytes = writer.encode(begin);
    for (wire::Seams& seams : all) {
      wire::Record record;
      *record.mutable_seams() = std::move(seams);
      const auto one = writer.encode(record);
      bytes.insert(bytes.end(), one.begin(), one.end());
    }
    return read_evidence(bytes, "takes/000001/evidence-0000");
  };
  const wire::Seams own = seams_record(8, kMaxSeamColumns, {});
  const wire::Seams placed = seams_record(16, kMaxSeamColumns, Labels(kPixels, 1));
  const auto good = read({own, placed});
  ASSERT_TRUE(good) << good.error().text();
  ASSERT_EQ(good->seams.size(), 2U);
  EXPECT_EQ(labels_of(good->seams[1]).value(), Labels(kPixels, 1));
  wire::Seams torn = placed;
  torn.mutable_runs()->pop_back();
  for (const auto& [what, seams] : {std::pair{"the same set twice", std::vector{placed, placed}},
                                    {"an earlier set", {placed, own}},
                                    {"a torn map", {own, torn}}}) {
    const auto refused = read(seams);
    ASSERT_FALSE(refused) << what;
    EXPECT_EQ(refused.error().message.find("takes/000001/evidence-0000: record 2: "), 0U) << refused.error().text();
    EXPECT_NE(refused.error().message.find("seams from set "), std::string::npos) << refused.error().text();
  }
}

}  // namespace
}  // namespace nodal::take
