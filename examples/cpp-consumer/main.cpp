#include <dualdrive/version.hpp>

#include <iostream>

int main() { std::cout << "dualdrive " << dualdrive::version() << '\n'; }
