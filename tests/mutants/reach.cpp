// Linked into a GoogleTest program: appends a line for each test to the file NODAL_REACH, "TEST seconds NUMBER ...":
// the changes that the test reached, while it ran and while its suite was set up.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>

#include "switch.h"

namespace nodal::mutants {
namespace {

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

class Reach final : public testing::EmptyTestEventListener {
 public:
  explicit Reach(const char* file) : out_(file, std::ios::app) {}

  void OnTestSuiteStart(const testing::TestSuite&) override {
    forget();
    start_ = processor_seconds();
  }

  void OnTestStart(const testing::TestInfo&) override {
    std::copy(std::begin(reached), std::end(reached), of_suite_);
    setting_up_ = processor_seconds() - start_;
    forget();
    start_ = processor_seconds();
  }

  void OnTestEnd(const testing::TestInfo& test) override {
    const bool passed = test.result()->Passed();
    out_ << (passed ? "passed " : "failed ") << test.test_suite_name() << '.' << test.name() << ' '
         << processor_seconds() - start_ + setting_up_;
    for (int number = 1; number < kMaxChanges; ++number) {
      if (reached[number] || of_suite_[number]) out_ << ' ' << number;
    }
    out_ << std::endl;
    std::copy(std::begin(of_suite_), std::end(of_suite_), reached);  // the suite's next test begins with these
    start_ = processor_seconds();
  }

 private:
  static void forget() { std::fill(std::begin(reached), std::end(reached), static_cast<unsigned char>(0)); }

  std::ofstream out_;
  unsigned char of_suite_[kMaxChanges] = {};
  double start_ = 0;
  double setting_up_ = 0;
};

[[maybe_unused]] const bool added = [] {
  const char* const file = std::getenv("NODAL_REACH");
  if (file) testing::UnitTest::GetInstance()->listeners().Append(new Reach(file));
  return file != nullptr;
}();

}  // namespace
}  // namespace nodal::mutants
