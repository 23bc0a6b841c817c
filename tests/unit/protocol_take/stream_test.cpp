// A stored stream as a record and back; the names of a take's files.
#include "protocol/take/stream.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/take/evidence.h"
#include "protocol/take/file_names.h"

namespace nodal::take {
namespace {

TEST(StreamFile, AsARecord_IsReadAgain) {
  for (const Fields fields : {Fields::kProgressive, Fields::kTopFirst, Fields::kBottomFirst}) {
    for (const bool second : {false, true}) {
      StreamFile file{"cam3-0001.mkv", 3, {PixelFormat::kYuyv, 720, 480, {second, !second}, fields, second}, !second};
      if (second) file.head.reset();
      wire::File record;
      write_stream_file(file, record);
      const StreamFile read = stream_file(record);
      EXPECT_EQ(read.name, file.name);
      EXPECT_EQ(read.head, file.head);
      EXPECT_EQ(read.stream, file.stream) << fields_name(fields);
      EXPECT_EQ(read.fields_apart, file.fields_apart);
    }
  }
}

TEST(StreamFile, WordsOfTheRecord_AreThoseOfItsDescription) {  // evidence.proto: the wire must not change
  wire::File record;
  StreamFile file;
  file.stream.format = PixelFormat::kYuyv;
  file.stream.fields = Fields::kBottomFirst;
  write_stream_file(file, record);
  EXPECT_EQ(record.fields(), "bottom-first");
  EXPECT_EQ(record.format(), "YUYV");
}

TEST(FieldsNamed, AnyOtherWord_IsNone) {
  EXPECT_EQ(fields_named("top-first"), Fields::kTopFirst);
  for (const char* word : {"", "top", "top-only", "bottom-only", "Top-First", "progressive "})
    EXPECT_FALSE(fields_named(word)) << word;
}

TEST(SegmentFile, Names_SayTheirHeadAndSegment) {
  for (const std::uint32_t segment : {0U, 7U, 9'999U, 10'000U, 99'999'999U}) {
    const auto head = segment_file(head_file(12, segment));
    ASSERT_TRUE(head) << segment;
    EXPECT_EQ(head->kind, SegmentFile::Kind::kHead);
    EXPECT_EQ(head->head, 12U);
    EXPECT_EQ(head->segment, segment);
    const auto raymaps = segment_file(raymap_file(segment)), evidence = segment_file(evidence_file(segment));
    ASSERT_TRUE(raymaps && evidence) << segment;
    EXPECT_EQ(raymaps->kind, SegmentFile::Kind::kRaymaps);
    EXPECT_EQ(evidence->kind, SegmentFile::Kind::kEvidence);
    EXPECT_EQ(evidence->segment, segment);
  }
}

TEST(SegmentFile, OtherNames_AreNotOfASegment) {
  for (const char* name :
       {"", "cam", "cam-0001.mkv", "cam0-1.mkv", "cam0-0001.mkv.part", "cam0-0001", "cam0-0001.mp4", "raymap-001.mkv",
        "evidence-", "evidence-0001.mkv", "evidence-123456789", "evidence-00001x", "../evidence-0001",
        "calibration-0001.json", "take.json", "cam4294967296-0001.mkv", "evidence-99999999999999999999"}) {
    EXPECT_FALSE(segment_file(name)) << name;
  }
  EXPECT_TRUE(is_take_file("calibration-0001.json"));
  EXPECT_FALSE(is_take_file("calibration-1.json"));
}

TEST(SegmentsAmong, NamesInAnyOrder_AreTheNumbersOfTheirEvidenceRising) {
  const std::vector<std::string> names{"evidence-0010", "cam0-0002.mkv", "evidence-0002", "take.json", "evidence-x"};
  EXPECT_EQ(segments_among(names), (std::vector<std::uint32_t>{2, 10}));
}

TEST(SeamsAt, ASet_HasTheNewestRecordUpToIt) {
  Segment segment;
  EXPECT_EQ(segment.seams_at(5), nullptr);
  for (const std::uint64_t set : {8U, 16U}) segment.seams.emplace_back().set_set(set);
  EXPECT_EQ(segment.seams_at(7), nullptr);
  EXPECT_EQ(segment.seams_at(8), &segment.seams[0]);
  EXPECT_EQ(segment.seams_at(15), &segment.seams[0]);
  EXPECT_EQ(segment.seams_at(UINT64_MAX), &segment.seams[1]);
}

}  // namespace
}  // namespace nodal::take
