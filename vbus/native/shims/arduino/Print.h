/* Print.h - Print, Stream and String of the Arduino API. License: Apache-2.0. */
#ifndef VBUS_SHIM_PRINT_H
#define VBUS_SHIM_PRINT_H

#include <stddef.h>
#include <stdint.h>
#include <string>

#define DEC 10
#define HEX 16
#define OCT 8
#define BIN 2

class __FlashStringHelper;
#define F(text) (reinterpret_cast<const __FlashStringHelper *>(text))

class String : public std::string {
public:
    String() {}
    String(const char *text) : std::string(text) {}
    String(const std::string &text) : std::string(text) {}
    String(const __FlashStringHelper *text) : std::string((const char *)text) {}
    explicit String(char value) : std::string(1, value) {}
    explicit String(long value, int base = DEC);
    explicit String(int value, int base = DEC) : String((long)value, base) {}
    explicit String(unsigned value, int base = DEC) : String((long)value, base) {}
    explicit String(double value, int digits = 2);

    char charAt(unsigned place) const { return place < size() ? (*this)[place] : '\0'; }
    int indexOf(char value) const { return (int)find(value); }
    long toInt() const;
    bool equals(const String &other) const { return *this == other; }
    String substring(unsigned from, unsigned to = ~0U) const
    {
        return from >= size() ? String() : String(substr(from, to - from));
    }
};

class Print {
public:
    virtual ~Print() {}
    virtual size_t write(uint8_t value) = 0;
    virtual size_t write(const uint8_t *data, size_t size);
    size_t write(const char *text);
    size_t write(const char *data, size_t size) { return write((const uint8_t *)data, size); }

    size_t print(const __FlashStringHelper *text) { return write((const char *)text); }
    size_t print(const String &text) { return write(text.data(), text.size()); }
    size_t print(const char *text) { return write(text); }
    size_t print(char value) { return write((uint8_t)value); }
    size_t print(unsigned char value, int base = DEC) { return number(value, base); }
    size_t print(int value, int base = DEC) { return print((long)value, base); }
    size_t print(unsigned value, int base = DEC) { return number(value, base); }
    size_t print(long value, int base = DEC);
    size_t print(unsigned long value, int base = DEC) { return number(value, base); }
    size_t print(double value, int digits = 2);

    size_t println() { return write("\r\n"); }
    template <class T> size_t println(const T &value) { return print(value) + println(); }
    template <class T> size_t println(const T &value, int how) { return print(value, how) + println(); }

private:
    size_t number(unsigned long value, int base);
};

class Stream : public Print {
public:
    virtual int available() = 0;
    virtual int read() = 0;
    virtual int peek() = 0;
};

#endif
