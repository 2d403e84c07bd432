// Where series come from: the server, or the page itself. Both answer alike.
//   get(keys, start, stop, pixels) -> Map of key -> {t, y, exact};  at(keys, time) -> [{key, t, value}]
// A key is {store, record, name, shift}; a shifted series is read earlier and shown later.

import { nearest, reduced } from "dd/reduce.js";

export const name = (key) => `${key.store}|${key.record}|${key.name}|${key.shift ?? 0}`;

// Series of one shift are asked for together.
function byShift(keys) {
  const groups = new Map();
  for (const key of keys) {
    const shift = key.shift ?? 0;
    if (!groups.has(shift)) groups.set(shift, new Map());
    groups.get(shift).set(name(key), key);
  }
  return groups;
}

export class ServerSource {
  constructor(connection) {
    this.connection = connection;
  }

  async get(keys, start, stop, pixels) {
    const found = new Map();
    for (const [shift, own] of byShift(keys)) {
      const told = [...own.values()].map((key) => [key.store, key.record, key.name]);
      const buffer = await this.connection.series({ keys: told, start: start - shift, stop: stop - shift, pixels });
      const length = new DataView(buffer).getUint32(0, true);
      const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
      let at = 8 + length;
      const take = (count) => {
        const part = new Float64Array(buffer, at, count);
        at += 8 * count;
        return part;
      };
      for (const group of head) {
        const raw = take(group.count);
        const t = shift ? raw.map((x) => x + shift) : raw;
        for (const column of group.names) {
          const key = { store: group.store, record: group.record, name: column, shift };
          found.set(name(key), { t, y: take(group.count), exact: group.exact });
        }
      }
    }
    return found;
  }

  async at(keys, time) {
    const found = [];
    for (const [shift, own] of byShift(keys)) {
      const told = [...own.values()].map((key) => [key.store, key.record, key.name]);
      for (const one of await this.connection.values({ keys: told, at: time - shift })) {
        found.push({ key: name({ ...one, shift }), t: one.t + shift, value: one.value });
      }
    }
    return found;
  }
}

// Stores held in the page: {store: {record: {t, columns: {name: array}}}}.
export class OwnSource {
  constructor(stores) {
    this.stores = stores;
  }

  async get(keys, start, stop, pixels) {
    const found = new Map();
    for (const key of keys) {
      const own = this.stores[key.store][key.record];
      const { t, values, exact } = reduced(own.t, [own.columns[key.name]], start, stop, pixels);
      found.set(name(key), { t, y: values[0], exact });
    }
    return found;
  }

  async at(keys, time) {
    return keys.map((key) => {
      const own = this.stores[key.store][key.record];
      const k = nearest(own.t, time);
      return { key: name(key), t: own.t[k], value: own.columns[key.name][k] };
    });
  }
}
