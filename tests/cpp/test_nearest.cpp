// Names that were meant: the ones a message proposes for a misspelt one.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "dualdrive/nearest.hpp"

using namespace dualdrive;

TEST_CASE("edit distance, ties in given order, no more than asked") {
    CHECK(nearest("gap", {"ratio", "gpa", "gap_", "cap"}, 2) == std::vector<std::string>{"gap_", "cap"});
    CHECK(nearest("kitten", {"sitting", "kitchen"}, 5) == std::vector<std::string>{"kitchen", "sitting"});
    CHECK(nearest("x", {}).empty());
}
