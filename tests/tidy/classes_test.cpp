// A class is small enough to be understood as a whole.
#include "classes.h"

#include <gtest/gtest.h>

namespace nodal::tidy {
namespace {

constexpr std::size_t kMaxMembers = 20;
constexpr std::size_t kMaxPrivateFunctions = 15;

TEST(Classes, EachHasAtMost20MembersAnd15PrivateFunctions) {
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path) || file.path.starts_with("tests/")) continue;
    for (const ClassSize& size : classes_in(file)) {
      EXPECT_TRUE(size.members <= kMaxMembers && size.private_functions <= kMaxPrivateFunctions)
          << file.path << ": " << size.name << " has " << size.members << " members and " << size.private_functions
          << " private functions; make a class of what belongs together, and free functions of what needs no member";
    }
  }
}

TEST(Classes, MembersAndPrivateFunctions_AreCounted) {
  const TextFile file{"a.h",
                      {"class Outer final : public Base<int> {",
                       " public:",
                       "  explicit Outer(int a) : a_(a), b_{a} {}",
                       "  int shown() const { return a_; }",
                       "  static constexpr int kMax = 3;",
                       "  enum class Kind { kOne, kTwo };",
                       "  int open = 0;",
                       "",
                       " private:",
                       "  class Inner {",
                       "    int of_inner_;",
                       "  };",
                       "  struct Record {",
                       "    int a, b;",
                       "    void f();",
                       "  };",
                       "  void first();  // { not counted",
                       "  std::map<int, std::string> second(int a = 3) const {",
                       "    if (a > 1) { return {}; }",
                       "    return {};",
                       "  }",
                       "  bool operator==(const Outer&) const = default;",
                       "  using Numbers = std::vector<int>;",
                       "  int a_, b_;",
                       "  std::map<int, int> by_number_{};",
                       "  std::function<void(int)> tell_;",
                       "  struct {",
                       "    int x;",
                       "  } unnamed_;",
                       "};"}};
  const std::vector<ClassSize> classes = classes_in(file);
  ASSERT_EQ(classes.size(), 2u);
  EXPECT_EQ(classes[0].name, "Outer");
  EXPECT_EQ(classes[0].members, 6u);
  EXPECT_EQ(classes[0].private_functions, 3u);
  EXPECT_EQ(classes[1].name, "Inner");
  EXPECT_EQ(classes[1].members, 1u);
}

}  // namespace
}  // namespace nodal::tidy
