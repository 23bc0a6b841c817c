// Evidence and documents of a take: written, read, damaged, hostile.
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "protocol/take/digest.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::take {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// A segment of one head with two rows of two sets, and its end.
std::vector<wire::Record> records() {
  std::vector<wire::Record> all;
  wire::Begin& begin = *all.emplace_back().mutable_begin();
  begin.set_version(1);
  wire::File& file = *begin.add_files();
  file.set_name("cam0-0000.mkv");
  file.set_head(0);
  file.set_format("GREY");
  file.set_width(4);
  file.set_height(2);
  file.set_head_bytes(1000);
  std::uint64_t at = 1000;
  for (std::uint64_t set = 0; set < 4; ++set) {
    wire::Set& to = *all.emplace_back().mutable_set();
    to.set_index(set);
    to.set_since_start_ns(static_cast<std::int64_t>(set) * 33'000'000);
    wire::Frame& frame = *to.add_frames();
    frame.set_at(at + 20);
    frame.set_bytes(8);
    at += 28;
    if (set % 2 == 0) continue;
    wire::Clusters& clusters = *all.emplace_back().mutable_clusters();
    clusters.set_sets(set + 1);
    clusters.add_end(at);
    clusters.add_hashes();
    if (set == 1) all.emplace_back().mutable_durable()->set_sets(2);
  }
  wire::End& end = *all.emplace_back().mutable_end();
  end.set_sets(4);
  end.add_length(at + 50);
  end.add_hashes(std::string(16, 'h'));
  return all;
}

Bytes bytes_of(const std::vector<wire::Record>& records) {
  EvidenceWriter writer;
  Bytes bytes;
  for (const wire::Record& record : records) {
    const Bytes one = writer.encode(record);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  return bytes;
}

TEST(TakeFiles, Evidence_IsReadAsItWasWritten) {
  const Bytes bytes = bytes_of(records());
  const auto segment = read_evidence(bytes, "evidence-0000");
  ASSERT_TRUE(segment) << segment.error().text();
  EXPECT_EQ(segment->sets.size(), 4U);
  EXPECT_EQ(segment->rows.size(), 2U);
  EXPECT_EQ(segment->durable_rows, 1U);
  EXPECT_EQ(segment->good_bytes, bytes.size());
  EXPECT_EQ(segment->hashes_of(0).size(), 1U);
}

TEST(TakeFiles, EvidenceCutAnywhere_IsReadUpToTheNewestWholeRecord) {
  const Bytes bytes = bytes_of(records());
  std::size_t sets = 0;
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    const auto segment = read_evidence(std::span(bytes).first(cut), "evidence-0000");
    if (!segment) {
      EXPECT_EQ(segment.error().code, Errc::kTruncated);
      EXPECT_EQ(sets, 0U);
      continue;
    }
    EXPECT_GE(segment->sets.size(), sets);
    EXPECT_LE(segment->good_bytes, cut);
    sets = segment->sets.size();
  }
  EXPECT_EQ(sets, 4U);
}

TEST(TakeFiles, EvidenceWithAChangedByte_EndsBeforeItsRecord) {
  const Bytes bytes = bytes_of(records());
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    Bytes changed = bytes;
    changed[k] ^= 0x10;
    const auto segment = read_evidence(changed, "evidence-0000");
    if (segment) {
      EXPECT_LE(segment->good_bytes, k);
    }
  }
}

wire::Record calibration(const std::string& file, std::uint64_t set) {
  wire::Record record;
  record.mutable_calibration()->set_file(file);
  record.mutable_calibration()->set_id(std::string(64, 'a'));
  record.mutable_calibration()->set_set(set);
  return record;
}

TEST(TakeFiles, EvidenceOfManyCalibrations_HasThemUpToTheLimit) {
  std::vector<wire::Record> many{records().front()};
  for (std::size_t k = 0; k < kMaxCalibrations; ++k) many.push_back(calibration(calibration_file(k + 1), k / 2));
  const auto segment = read_evidence(bytes_of(many), "evidence-0000");
  ASSERT_TRUE(segment) << segment.error().text();
  EXPECT_EQ(segment->calibrations.size(), kMaxCalibrations);
  many.push_back(calibration(calibration_file(kMaxCalibrations + 1), kMaxCalibrations));
  EXPECT_FALSE(read_evidence(bytes_of(many), "evidence-0000"));
}

TEST(TakeFiles, ABeginWithoutAFileOrVersion_IsRefusedWithoutAnyRecordAfterIt) {
  EXPECT_TRUE(read_evidence(bytes_of({records().front()}), "evidence-0000"));
  for (const bool files : {true, false}) {
    std::vector<wire::Record> begin{records().front()};
    if (files) begin[0].mutable_begin()->clear_files();
    else begin[0].mutable_begin()->set_version(0);
    const auto segment = read_evidence(bytes_of(begin), "evidence-0000");
    ASSERT_FALSE(segment);
    EXPECT_EQ(segment.error().code, Errc::kBadFormat);
  }
}

TEST(TakeFiles, EvidenceThatContradictsItself_IsRefusedWithItsRecord) {
  struct Case {
    const char* what;
    std::function<void(std::vector<wire::Record>&)> spoil;
  };
  const std::vector<Case> cases = {
      {"a newer version", [](auto& r) { r[0].mutable_begin()->set_version(2); }},
      {"a name that leads outside",
       [](auto& r) { r[0].mutable_begin()->mutable_files(0)->set_name("../cam0-0000.mkv"); }},
      {"a head that no rig has", [](auto& r) { r[0].mutable_begin()->mutable_files(0)->set_head(16); }},
      {"the same file twice", [](auto& r) { *r[0].mutable_begin()->add_files() = r[0].begin().files(0); }},
      {"no file", [](auto& r) { r[0].mutable_begin()->clear_files(); }},
      {"a picture without size", [](auto& r) { r[0].mutable_begin()->mutable_files(0)->set_width(0); }},
      {"a first set beyond all", [](auto& r) { r[0].mutable_begin()->set_first_set(UINT64_MAX); }},
      {"two begins", [](auto& r) { r[1] = r[0]; }},
      {"a set left out", [](auto& r) { r.erase(r.begin() + 1); }},
      {"a time that falls", [](auto& r) { r[2].mutable_set()->set_since_start_ns(-1); }},
      {"a frame in no file", [](auto& r) { r[1].mutable_set()->mutable_frames(0)->set_file(3); }},
      {"a frame before the file's end", [](auto& r) { r[1].mutable_set()->mutable_frames(0)->set_at(999); }},
      {"a frame beyond all", [](auto& r) { r[1].mutable_set()->mutable_frames(0)->set_at(UINT64_MAX); }},
      {"a frame larger than all", [](auto& r) { r[1].mutable_set()->mutable_frames(0)->set_bytes(UINT64_MAX); }},
      {"no frame of a head", [](auto& r) { r[1].mutable_set()->clear_frames(); }},
      {"a file that becomes shorter", [](auto& r) { r[3].mutable_clusters()->set_end(0, 1010); }},
      {"a length without hashes", [](auto& r) { r[3].mutable_clusters()->set_end(0, std::uint64_t{1} << 30); }},
      {"half a hash", [](auto& r) { r[3].mutable_clusters()->set_hashes(0, "half"); }},
      {"lengths of other files", [](auto& r) { r[3].mutable_clusters()->add_end(5); }},
      {"an end for fewer sets", [](auto& r) { r.back().mutable_end()->set_sets(3); }},
      {"a calibration outside of the folder",
       [](auto& r) { r.insert(r.begin() + 1, calibration("../calibration-0001.json", 1)); }},
      {"a calibration left out", [](auto& r) { r.insert(r.begin() + 1, calibration(calibration_file(2), 1)); }},
      {"a calibration from an earlier set on",
       [](auto& r) {
         r.insert(r.begin() + 1, calibration(calibration_file(2), 1));
         r.insert(r.begin() + 1, calibration(calibration_file(1), 2));
       }},
      {"a record after the end", [](auto& r) { r.push_back(r[1]); }},
  };
  for (const Case& each : cases) {
    std::vector<wire::Record> spoilt = records();
    each.spoil(spoilt);
    const auto segment = read_evidence(bytes_of(spoilt), "evidence-0000");
    ASSERT_FALSE(segment) << each.what;
    EXPECT_NE(segment.error().message.find("evidence-0000: record "), std::string::npos) << segment.error().text();
  }
}

TEST(TakeFiles, AReaderThatRefusedARecord_HasNoSegmentInTheEnd) {
  std::vector<wire::Record> spoilt = records();
  spoilt[2].mutable_set()->set_since_start_ns(-1);
  EvidenceReader reader("evidence-0000");
  const Status refused = reader.add(bytes_of(spoilt));
  ASSERT_FALSE(refused);
  const auto segment = std::move(reader).finish();
  ASSERT_FALSE(segment);
  EXPECT_EQ(segment.error().text(), refused.error().text());
}

TEST(TakeFiles, Documents_AreReadAsTheyWereWritten) {
  TakeDocument take;
  take.number = 42;
  take.rig = "a rig";
  take.software = "nodald";
  take.started_utc_ns = 1'700'000'000'000'000'000;
  take.mode = "driver";
  take.layout = "cube";
  take.heads = {"left", "right"};
  take.raymap_width = 2048;
  take.raymap_height = 1024;
  const auto again = parse_take_json(take_json(take), "take.json");
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(take_json(*again), take_json(take));
  Manifest manifest;
  manifest.number = 42;
  manifest.sets = 7;
  manifest.length = Duration::seconds(3);
  manifest.ended = "stopped";
  manifest.marks = {{3, "the bus"}, {5, ""}};
  manifest.calibrations = {{"calibration-0001.json", std::string(64, '0'), 5}};
  manifest.files = {{"cam0-0000.mkv", 1000, xxh128(Bytes{1, 2, 3})}, {"evidence-0000", 20, {}}};
  const auto read = parse_manifest(manifest_json(manifest), "manifest");
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(manifest_json(*read), manifest_json(manifest));
  EXPECT_EQ(read->bytes(), 1020U);
  EXPECT_EQ(read->calibrations, manifest.calibrations);
}

TEST(TakeFiles, HostileDocuments_AreRefusedByName) {
  Manifest manifest;
  manifest.calibrations = {{"calibration-0001.json", std::string(64, 'b'), 5}};
  manifest.files = {{"cam0-0000.mkv", 1000, {}}};
  const std::string good = manifest_json(manifest);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  for (const std::string& text : {std::string(),
                                  std::string("[]"),
                                  std::string("{}"),
                                  with("cam0-0000.mkv", "../x"),
                                  with("cam0-0000.mkv", "manifest"),
                                  with("cam0-0000.mkv", "cam0-0000.mkv/x"),
                                  with("1000", "-1"),
                                  with("1000", "99999999999999999999"),
                                  with("1000", "1e3"),
                                  with("\"version\": 1", "\"version\": 2"),
                                  with("00000000", "0000000g"),
                                  with("\"sets\": 0", "\"sets\": \"0\""),
                                  with("\"marks\": []", "\"marks\": [1]"),
                                  with("\"marks\": []", "\"marks\": {}"),
                                  with("n-0001", "n-0002"),
                                  with("n-0001.json", "n-0001/.."),
                                  with("bbb", "bb"),
                                  with("bbb", "bBb"),
                                  with("\"set\": 5", "\"set\": -5"),
                                  std::string(kMaxManifestBytes + 1, ' ')}) {
    const auto read = parse_manifest(text, "the-manifest");
    ASSERT_FALSE(read) << text.substr(0, 200);
    EXPECT_NE(read.error().message.find("the-manifest"), std::string::npos) << read.error().text();
  }
  for (const char* text : {"", "{}", "{\"version\": 1}", "{\"version\": 1, \"take\": -5}"}) {
    EXPECT_FALSE(parse_take_json(text, "take.json"));
  }
  EXPECT_FALSE(parse_take_json(std::string(kMaxTakeJsonBytes + 1, ' '), "take.json"));
}

// XXH3-128 with seed 0 of no bytes, as xxHash's specification gives it.
TEST(TakeFiles, HashOfNothing_IsThatOfTheSpecification) {
  EXPECT_EQ(to_hex(xxh128({})), "99aa06d3014798d86001c324468d497f");
  EXPECT_EQ(xxh128_of_hex("99aa06d3014798d86001c324468d497f"), xxh128({}));
  EXPECT_FALSE(xxh128_of_hex("99AA06d3014798d86001c324468d497f"));
}

}  // namespace
}  // namespace nodal::take
