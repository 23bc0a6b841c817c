// The audit file: its chain, computed here with SHA-256 alone, and what is found when somebody or the power changes it.
#include "firmware/storage/audit_store.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "hal/sim/disk.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimDisk;

/// A store on a disk, and what it has been told.
class Storing {
 public:
  explicit Storing(SimDisk& disk) : store(disk) {
    store.step({});
    report = store.snapshot().read();
    next = report.newest + 1;
  }
  /// Writes a record; true when it is on the disk.
  bool write(const std::string& text) {
    EXPECT_TRUE(store.writes().push({next, text}));
    store.step({});
    const auto written = store.answers().pop();
    if (!written || !written->status) return false;
    EXPECT_EQ(written->number, next);
    head = written->head;
    ++next;
    return true;
  }
  AuditStore store;
  AuditReport report;
  std::uint64_t next = 1;
  Sha256 head{};
};

std::string text_of(SimDisk& disk, const std::string& file) {
  const auto bytes = disk.read(file, 1 << 20);
  return bytes ? std::string(bytes->begin(), bytes->end()) : "";
}

void put(SimDisk& disk, const std::string& file, const std::string& text) {
  (void)disk.remove(file);
  const auto handle = disk.create(file);
  ASSERT_TRUE(handle);
  ASSERT_TRUE(disk.write(*handle, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}));
  disk.close(*handle);
}

std::vector<std::string> texts(const AuditReport& report) {
  std::vector<std::string> all;
  for (const AuditRecord& record : *report.records) all.push_back(std::to_string(record.number) + " " + record.text);
  return all;
}

std::string hash(const std::string& text) {
  return to_hex(sha256({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}));
}

TEST(AuditStore, ARecord_HasTheHashOfTheOneBeforeItsNumberAndItsText) {
  SimDisk disk;
  Storing storing(disk);
  ASSERT_TRUE(storing.write("one\twith tabs"));
  ASSERT_TRUE(storing.write("two"));
  const std::string none(64, '0');
  const std::string first = hash(none + " 1 one\twith tabs");
  const std::string second = hash(first + " 2 two");
  EXPECT_EQ(text_of(disk, kAuditFile),
            "nodal-audit 1 0 " + none + "\n" + first + " 1 one\twith tabs\n" + second + " 2 two\n");
  EXPECT_EQ(to_hex(storing.head), second);
}

TEST(AuditStore, AfterARestart_TheChainGoesOn) {
  SimDisk disk;
  {
    Storing storing(disk);
    for (const char* text : {"one", "two"}) ASSERT_TRUE(storing.write(text));
  }
  Storing again(disk);
  EXPECT_EQ(texts(again.report), (std::vector<std::string>{"1 one", "2 two"}));
  EXPECT_TRUE(again.report.findings.empty());
  ASSERT_TRUE(again.write("three"));
  EXPECT_EQ(texts(Storing(disk).report), (std::vector<std::string>{"1 one", "2 two", "3 three"}));
}

TEST(AuditStore, MoreThanTwoFilesHold_TheOldestGoAndTheChainOfTheOthersIsWhole) {
  SimDisk disk;
  Storing storing(disk);
  for (int i = 1; i <= 9000; ++i) ASSERT_TRUE(storing.write(std::string(100, 'x')));
  EXPECT_LE(disk.size(kAuditFile).value(), AuditStore::kMaxFileBytes);
  EXPECT_LE(disk.size(kAuditBeforeFile).value(), AuditStore::kMaxFileBytes);
  Storing again(disk);
  EXPECT_TRUE(again.report.findings.empty()) << again.report.findings.front();
  EXPECT_EQ(again.report.newest, 9000u);
  EXPECT_GT(again.report.records->front().number, 1u);
  EXPECT_GT(again.report.records->size(), AuditStore::kMaxFileBytes / 200);
}

class ChangedAuditFile : public testing::Test {
 protected:
  ChangedAuditFile() {
    Storing storing(disk);
    for (const char* text : {"one", "two", "three", "four"}) EXPECT_TRUE(storing.write(text));
    whole = text_of(disk, kAuditFile);
  }
  /// Begin of the line of record n.
  std::size_t line(int n) const {
    std::size_t at = 0;
    for (int i = 0; i < n; ++i) at = whole.find('\n', at) + 1;
    return at;
  }
  SimDisk disk;
  std::string whole;
};

TEST_F(ChangedAuditFile, ATextOfOneRecord_IsABrokenChainAtThatRecordAndNothingIsCut) {
  for (int n = 1; n <= 4; ++n) {
    std::string changed = whole;
    changed[changed.find('\n', line(n)) - 1] = 'X';
    put(disk, kAuditFile, changed);
    const Storing storing(disk);
    ASSERT_EQ(storing.report.findings.size(), 1u) << n;
    EXPECT_NE(storing.report.findings[0].find("the chain is broken after record " + std::to_string(n - 1)),
              std::string::npos)
        << storing.report.findings[0];
    EXPECT_EQ(storing.report.records->size(), 4u);
    EXPECT_EQ(storing.next, 5u);
  }
}

TEST_F(ChangedAuditFile, ARecordThatWasRemoved_IsABrokenChain) {
  for (int n = 1; n <= 3; ++n) {
    put(disk, kAuditFile, whole.substr(0, line(n)) + whole.substr(line(n + 1)));
    const Storing storing(disk);
    ASSERT_EQ(storing.report.findings.size(), 1u) << n;
    EXPECT_NE(storing.report.findings[0].find("broken after record " + std::to_string(n - 1)), std::string::npos);
    EXPECT_EQ(storing.report.records->size(), 3u);
  }
}

TEST_F(ChangedAuditFile, TheFileBeforeIsGone_IsABrokenChain) {
  put(disk, kAuditFile, "nodal-audit 1 7 " + std::string(64, 'a') + "\n");
  const Storing storing(disk);
  ASSERT_EQ(storing.report.findings.size(), 1u);
  EXPECT_NE(storing.report.findings[0].find("between records 0 and 8"), std::string::npos)
      << storing.report.findings[0];
}

TEST_F(ChangedAuditFile, ATornEnd_IsReportedAndCutByTheNextRecord) {
  for (std::size_t cut = line(4) + 1; cut < whole.size(); ++cut) {
    put(disk, kAuditFile, whole.substr(0, cut));
    Storing storing(disk);
    ASSERT_EQ(storing.report.findings.size(), 1u) << cut;
    EXPECT_NE(storing.report.findings[0].find("incomplete record"), std::string::npos);
    EXPECT_EQ(storing.report.newest, 3u);
    ASSERT_TRUE(storing.write("another"));
    const Storing again(disk);
    EXPECT_TRUE(again.report.findings.empty());
    EXPECT_EQ(texts(again.report).back(), "4 another");
  }
}

/// The disk fails in operation k of writing, for every k: what is not on the disk is tried again, and nothing is
/// written twice.
TEST(AuditStore, AnyOperationFailsOnce_TheRecordIsWrittenLater) {
  for (std::uint64_t k = 0; k < 40; ++k) {
    SimDisk disk;
    Storing storing(disk);
    disk.fail_at(disk.operations() + k);
    Instant now;
    std::uint64_t written = 0;
    for (std::uint64_t n = 1; n <= 5; ++n) {
      ASSERT_TRUE(storing.store.writes().push({n, "record " + std::to_string(n)}));
      for (int tries = 0; written < n && tries < 3; ++tries) {
        now = now + AuditStore::kRetryEvery;
        storing.store.step(now);
        const auto answer = storing.store.answers().pop();
        ASSERT_TRUE(answer);
        EXPECT_EQ(answer->number, n);
        if (answer->status) written = n;
      }
    }
    ASSERT_EQ(written, 5u) << k;
    const Storing again(disk);
    EXPECT_TRUE(again.report.findings.empty()) << k << ": " << again.report.findings.front();
    EXPECT_EQ(again.report.records->size(), 5u) << k;
  }
}

}  // namespace
}  // namespace nodal::firmware
