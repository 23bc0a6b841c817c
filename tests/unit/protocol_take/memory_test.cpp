// Documents and evidence that are as large as they may be, and hostile ones: their readers stay within the memory of
// LIMITS.md.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/support/within_memory.h"

namespace nodal::take {
namespace {

using test::within_memory;

/// `head`, then `part(k)` while it is not empty and the text has room, then `tail`: as pieces, of which one is in
/// memory.
class Pieces {
 public:
  Pieces(std::string head, std::function<std::string(std::size_t)> part, std::string tail,
         std::size_t most = kMaxManifestBytes)
      : next_(std::move(head)), part_(std::move(part)), tail_(std::move(tail)), most_(most) {}

  Result<std::string_view> operator()() {
    piece_ = std::exchange(next_, {});
    while (!ended_ && piece_.size() < (1 << 20)) {
      const std::string part = part_(count_++);
      ended_ = part.empty() || given_ + piece_.size() + part.size() + tail_.size() > most_;
      piece_ += ended_ ? tail_ : part;
    }
    given_ += piece_.size();
    return std::string_view(piece_);
  }

 private:
  std::string next_, piece_;
  std::function<std::string(std::size_t)> part_;
  std::string tail_;
  std::size_t most_, given_ = 0, count_ = 0;
  bool ended_ = false;
};

std::function<std::string(std::size_t)> always(const std::string& text) {
  return [text](std::size_t) { return text; };
}

constexpr const char* kFields =
    R"({"take": 1, "version": 1, "sets": 0, "lost_sets": 0, "length_ns": 0, "ended": "", "marks": [],)";
const std::uint64_t kManifestMiB = test::memory_on_page(NODAL_SOURCE_DIR, "a manifest");

TEST(TakeMemory, ManifestOfAsManyFilesAsThereMayBe_IsReadWithinItsBudget) {
  EXPECT_TRUE(within_memory(kManifestMiB, [] {
    const auto file = [](std::size_t k) {
      if (k == kMaxTakeFiles) return std::string();
      return fmt::format("{}{{\"name\": \"cam{}-{:08}.mkv\", \"bytes\": 1, \"xxh3\": \"{}\"}}", k == 0 ? "" : ",",
                         k % 16, k / 16, std::string(32, 'a'));
    };
    const auto read = parse_manifest(Pieces(std::string(kFields) + "\"files\": [", file, "]}"), "manifest");
    return read && read->files.size() == kMaxTakeFiles;
  }));
}

TEST(TakeMemory, HostileManifestsOfTheLargestSize_AreRefusedWithinTheirBudget) {
  struct Case {
    const char* what;
    std::string head, part, tail;
  };
  const std::string files = std::string(kFields) + "\"files\": [";
  for (const Case& each :
       {Case{"objects one after the other", "", "{}", ""}, Case{"a list of objects", "[", "{},", "{}]"},
        Case{"files without fields", files, "{},", "{}]}"}, Case{"files that are lists", files, "[],", "[]]}"},
        Case{"numbers for files", files, "1,", "1]}"}, Case{"words for files", files, "null,", "null]}"},
        Case{"the same file", files, R"({"name":"cam0-0000.mkv","bytes":1,"xxh3":")" + std::string(32, 'a') + "\"},",
             "]}"},
        Case{"one text", "{\"ended\": \"", "aaaaaaaa", "\"}"},
        Case{"one text of escapes", "{\"ended\": \"", "\\u0001", "\"}"}, Case{"one key", "{\"", "aaaaaaaa", "\": 1}"},
        Case{"one number", "{\"take\": 1", "11111111", "}"}, Case{"keys", "{", "\"a\": 1,", "\"b\": 1}"},
        Case{"lists in lists", "", "[", ""},
        Case{"a field that nobody knows", "{\"x\": [", "{\"y\": [1, 2, 3]},", "0]}"},
        Case{"white space", "", "        ", ""},
        Case{"marks", R"({"marks": [)", R"({"set": 1, "text": "aaaaaaaa"},)", "0]}"}}) {
    EXPECT_TRUE(within_memory(kManifestMiB, [&] {
      const auto read = parse_manifest(Pieces(each.head, always(each.part), each.tail), "the-manifest");
      return !read && read.error().message.find("the-manifest") != std::string::npos;
    })) << each.what;
  }
}

TEST(TakeMemory, HostileTakeJsonOfTheLargestSize_IsRefusedWithinItsBudget) {
  for (const char* part : {"{},", "[", "1,", "\"a\":", " "}) {
    std::string text = "[";
    while (text.size() < kMaxTakeJsonBytes - 8) text += part;
    EXPECT_TRUE(within_memory(test::memory_on_page(NODAL_SOURCE_DIR, "take.json"), [&] {
      return !parse_take_json(text, "take.json");
    })) << part;
  }
}

TEST(TakeMemory, ManifestWithoutAnEnd_IsRefusedWhenItIsTooLarge) {
  EXPECT_TRUE(within_memory(kManifestMiB, [] {
    const auto read = parse_manifest([]() -> Result<std::string_view> { return " \n \n \n "; }, "manifest");
    return !read && read.error().code == Errc::kTooLarge;
  }));
}

wire::Record begin(int heads, bool raymaps) {
  wire::Record record;
  wire::Begin& begin = *record.mutable_begin();
  begin.set_version(1);
  for (int k = 0; k < heads + (raymaps ? 1 : 0); ++k) {
    wire::File& file = *begin.add_files();
    file.set_name(k < heads ? head_file(static_cast<std::uint32_t>(k), 0) : raymap_file(0));
    if (k < heads) file.set_head(static_cast<std::uint32_t>(k));
    file.set_format("MJPEG");
    file.set_width(4);
    file.set_height(2);
  }
  return record;
}

/// Gives records to a reader until it refuses, or has the bytes that evidence may have.
class Evidence {
 public:
  Status add(const wire::Record& record) {
    const auto bytes = writer_.encode(record);
    bytes_ += bytes.size();
    return reader_.add(bytes);
  }
  bool full() const { return bytes_ + (64 << 10) > kMaxEvidenceBytes; }
  Result<Segment> finish() { return std::move(reader_).finish(); }

 private:
  EvidenceWriter writer_;
  EvidenceReader reader_{"evidence-0000"};
  std::uint64_t bytes_ = 0;
};

wire::Record set(std::uint64_t index, int heads) {
  wire::Record record;
  wire::Set& set = *record.mutable_set();
  set.set_index(index);
  set.set_genlock("locked");
  for (int k = 0; k < heads; ++k) {
    wire::Frame& frame = *set.add_frames();
    frame.set_file(static_cast<std::uint32_t>(k));
    frame.set_placeholder("missing");
  }
  return record;
}

wire::Record clusters(std::uint64_t sets, int files) {
  wire::Record record;
  record.mutable_clusters()->set_sets(sets);
  for (int k = 0; k < files; ++k) {
    record.mutable_clusters()->add_end(0);
    record.mutable_clusters()->add_hashes();
  }
  return record;
}

const std::uint64_t kEvidenceMiB =
    test::memory_on_page(NODAL_SOURCE_DIR, "the evidence of a segment, and a record of it");

TEST(TakeMemory, EvidenceOfAsManySetsAsThereMayBe_IsReadWithinItsBudgetAndOneMoreIsRefused) {
  EXPECT_TRUE(within_memory(kEvidenceMiB, [] {
    Evidence evidence;
    bool good = evidence.add(begin(16, true)).has_value();
    for (std::uint64_t k = 0; good && k < kMaxSegmentSets; ++k)
      good = evidence.add(set(k, 16)).has_value() && evidence.add(clusters(k + 1, 17)).has_value();
    if (!good) return false;
    const Status more = evidence.add(set(kMaxSegmentSets, 16));
    return !more && more.error().code == Errc::kTooLarge;
  }));
}

TEST(TakeMemory, EvidenceOfRaymapsRowsOrSeamsWithoutEnd_IsRefusedWithinItsBudget) {
  EXPECT_TRUE(within_memory(kEvidenceMiB, [] {
    Evidence evidence;
    wire::Record flood = clusters(0, 2);
    for (int k = 0; k < 30'000; ++k) flood.mutable_clusters()->add_raymaps();
    Status added = evidence.add(begin(1, true));
    while (added && !evidence.full()) added = evidence.add(flood);
    return !added && added.error().code == Errc::kTooLarge;
  }));
  EXPECT_TRUE(within_memory(kEvidenceMiB, [] {
    Evidence evidence;
    Status added = evidence.add(begin(16, false));
    while (added && !evidence.full()) added = evidence.add(clusters(0, 16));
    return !added && added.error().code == Errc::kTooLarge;
  }));
  EXPECT_TRUE(within_memory(kEvidenceMiB, [] {
    Evidence evidence;
    wire::Record seams;
    Status added = evidence.add(begin(1, false));
    for (std::uint64_t k = 1; added && !evidence.full(); ++k) {
      seams.mutable_seams()->set_set(k);
      added = evidence.add(seams);
    }
    return !added && added.error().code == Errc::kTooLarge;
  }));
}

}  // namespace
}  // namespace nodal::take
