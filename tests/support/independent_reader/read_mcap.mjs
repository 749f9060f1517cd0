// Reads MCAP files by code that shares nothing with EndoTwin's, and prints as JSON what is in them.
//
//     npm ci && node read_mcap.mjs [--values] FILE...
//
// Every message is read twice, by the index at the end of the file and as a stream from its beginning, with all
// CRCs checked, and decoded by the schema that the file itself holds. `--values` adds the time and the value of
// every field in every message, as 8 bytes each, little-endian, in base64: exact to the last bit.
// Ends with code 1 and one line where a file is damaged, or where the two ways of reading differ.

import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";

import { createFileRegistry, fromBinary } from "@bufbuild/protobuf";
import { reflect } from "@bufbuild/protobuf/reflect";
import { FeatureSet_FieldPresence, FileDescriptorSetSchema } from "@bufbuild/protobuf/wkt";
import { crc32 } from "@foxglove/crc";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { decompress } from "fzstd";

const decompressHandlers = {
  zstd: (data, size) => decompress(data, new Uint8Array(Number(size))),
};

async function readByIndex(bytes) {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => bytes.subarray(Number(offset), Number(offset + size)),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const content = { channels: reader.channelsById, schemas: reader.schemasById, messages: [] };
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    content.messages.push(message);
  }
  content.metadata = await all(reader.readMetadata());
  content.attachments = await all(reader.readAttachments({ validateCrcs: true }));
  content.statistics = reader.statistics;
  const crc = crc32(bytes.subarray(0, Number(reader.dataEndOffset)));
  if (reader.dataSectionCrc !== undefined && crc !== reader.dataSectionCrc) {
    throw new Error(`Incorrect data section CRC ${crc} (expected ${reader.dataSectionCrc})`);
  }
  return content;
}

function readAsStream(bytes) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  const content = { channels: new Map(), schemas: new Map(), messages: [], metadata: [], attachments: [] };
  const keep = {
    Schema: (record) => content.schemas.set(record.id, record),
    Channel: (record) => content.channels.set(record.id, record),
    Message: (record) => content.messages.push(record),
    Metadata: (record) => content.metadata.push(record),
    Attachment: (record) => content.attachments.push(record),
  };
  reader.append(bytes);
  for (let record; (record = reader.nextRecord()); ) {
    keep[record.type]?.(record);
  }
  if (!reader.done() || reader.bytesRemaining() > 0) {
    throw new Error("the stream ends before the file does, or the file before the stream");
  }
  return content;
}

async function all(records) {
  const list = [];
  for await (const record of records) {
    list.push(record);
  }
  return list;
}

/** Topics with their schemas and messages in the order of time, metadata and attachments by name. */
function summarise(content, withValues) {
  const topics = {};
  for (const [id, channel] of content.channels) {
    const schema = content.schemas.get(channel.schemaId);
    const messages = content.messages.filter((message) => message.channelId === id);
    messages.sort((one, other) => Number(one.logTime - other.logTime));
    topics[channel.topic] = {
      schema: schema.name,
      encoding: `${schema.encoding}, ${channel.messageEncoding}`,
      ...summariseTimes(messages, withValues),
      fields: summariseFields(messages, schema, withValues),
      payload_sha256: sha256(Buffer.concat(messages.map((message) => message.data))),
    };
  }
  return {
    topics: sorted(topics),
    metadata: content.metadata.map(({ name, metadata }) => ({ name, entries: Object.fromEntries(metadata) })),
    attachments: content.attachments.map(({ name, mediaType, data }) => ({
      name,
      media_type: mediaType,
      size: data.length,
      sha256: sha256(data),
    })),
  };
}

function summariseTimes(messages, withValues) {
  const logTimes = messages.map((message) => message.logTime);
  const publishTimes = messages.map((message) => message.publishTime);
  const sum = logTimes.reduce((total, time) => total + time, 0n);
  return {
    count: messages.length,
    first_log_time: String(logTimes[0] ?? ""),
    last_log_time: String(logTimes.at(-1) ?? ""),
    sum_of_log_times: String(sum),
    ...(withValues && {
      log_times: base64(BigUint64Array.from(logTimes)),
      publish_times: base64(BigUint64Array.from(publishTimes)),
    }),
  };
}

/** What each field, such as `joints[2].position`, holds along the messages that have it. */
function summariseFields(messages, schema, withValues) {
  const files = createFileRegistry(fromBinary(FileDescriptorSetSchema, schema.data));
  const type = files.getMessage(schema.name);
  if (type === undefined) {
    throw new Error(`the schema ${schema.name} does not describe itself`);
  }
  const columns = {};
  for (const message of messages) {
    flatten(reflect(type, fromBinary(type, message.data)), "", columns);
  }
  const fields = {};
  for (const [path, values] of Object.entries(columns)) {
    fields[path] = { count: values.length };
    if (typeof values[0] === "string") {
      fields[path].texts = withValues ? values : [...new Set(values)].slice(0, 10);
    } else {
      fields[path].min = values.reduce((least, value) => Math.min(least, value), Infinity);
      fields[path].max = values.reduce((most, value) => Math.max(most, value), -Infinity);
      if (withValues) {
        fields[path].values = base64(Float64Array.from(values));
      }
    }
  }
  return sorted(fields);
}

/** Append every set field below a message to the column of its path; one without presence is always set. */
function flatten(message, prefix, columns) {
  for (const field of message.fields) {
    const path = prefix + field.name;
    if (field.fieldKind === "list") {
      [...message.get(field)].forEach((value, index) => append(field.message, value, `${path}[${index}]`, columns));
    } else if (field.fieldKind === "map") {
      throw new Error(`${path} is a map, which no message of an episode has`);
    } else if (message.isSet(field) || field.presence === FeatureSet_FieldPresence.IMPLICIT) {
      append(field.message, message.get(field), path, columns);
    }
  }
}

function append(type, value, path, columns) {
  if (type !== undefined) {
    flatten(value, `${path}.`, columns);
    return;
  }
  columns[path] ??= [];
  columns[path].push(plain(value, path));
}

/** A number, or a text: of bytes, their hash. */
function plain(value, path) {
  if (value instanceof Uint8Array) {
    return sha256(value);
  }
  if (typeof value === "bigint" && BigInt.asIntN(54, value) !== value) {
    throw new Error(`${path} = ${value} is no double`);
  }
  return typeof value === "string" ? value : Number(value);
}

function sha256(data) {
  return createHash("sha256").update(data).digest("hex");
}

function base64(array) {
  return Buffer.from(array.buffer).toString("base64");
}

function sorted(object) {
  return Object.fromEntries(Object.keys(object).sort().map((key) => [key, object[key]]));
}

async function read(file, withValues) {
  const bytes = new Uint8Array(readFileSync(file));
  const indexed = await readByIndex(bytes);
  const summary = summarise(indexed, withValues);
  const streamed = summarise(readAsStream(bytes), withValues);
  if (JSON.stringify(summary) !== JSON.stringify(streamed)) {
    throw new Error("the index of the file and its stream of records do not agree");
  }
  return { file, message_count: String(indexed.statistics?.messageCount ?? ""), ...summary };
}

const withValues = process.argv.includes("--values");
const files = process.argv.slice(2).filter((argument) => argument !== "--values");
if (files.length === 0) {
  console.error("usage: node read_mcap.mjs [--values] FILE...");
  process.exit(2);
}
const summaries = [];
for (const file of files) {
  try {
    summaries.push(await read(file, withValues));
  } catch (error) {
    console.error(`${file}: ${error.message}`);
    process.exit(1);
  }
}
console.log(JSON.stringify(summaries, null, withValues ? undefined : 2));
